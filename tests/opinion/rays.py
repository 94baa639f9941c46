"""Rays through a scene: scans of three LiDARs, random ones, and ones that graze ground and edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.scenes import Scene
from sitl.sensors.mid360 import Mid360
from sitl.sensors.ouster_os1 import Ouster
from sitl.sensors.vlp16 import Vlp16
from tests.opinion.meshes import heights

F64 = NDArray[np.float64]
SENSORS = {"Mid-360": Mid360, "VLP-16": Vlp16, "OS1": Ouster}
PULSES = 5_000
HEIGHTS_M = (3.0, 12.0, 30.0)
ORIGINS, FROM_EACH = 40, 400
VERTICAL, VERTICAL_FROM_M = 2_000, 500.0


@dataclass(frozen=True, slots=True)
class Rays:
    """Rays of one kind: origins and unit directions (n, 3), ENU metres."""

    kind: str
    origins: F64
    directions: F64

    def __len__(self) -> int:
        return len(self.origins)


def sets(scene: Scene, rng: np.random.Generator) -> list[Rays]:
    """Return the rays for a scene, one set of each kind."""
    return [
        *_scans(scene, rng),
        _random(scene, rng),
        _grazing(scene, rng),
        _at_edges(scene, rng),
        _vertical(scene, rng),
    ]


def _scans(scene: Scene, rng: np.random.Generator) -> list[Rays]:
    home = np.array(scene.home_enu[:2])
    found = []
    for kind, make in SENSORS.items():
        sensor = make(np.random.default_rng(0))
        origins, directions = [], []
        for height_m in HEIGHTS_M:
            first = int(rng.integers(1_000_000))
            index = np.arange(first, first + PULSES)
            place = _inside(scene, home + rng.uniform(-20.0, 20.0, 2))
            attitude = np.tile(_attitude(rng), (PULSES, 1))
            at = np.array([*place, scene.world.height_m(*place) + height_m])
            origin = at + sensor.mount.lever_enu_m(attitude)
            offset = sensor.origins_m(index)
            if offset is not None:
                origin = origin + sensor.mount.to_enu(offset, attitude)
            origins.append(origin)
            directions.append(sensor.mount.to_enu(sensor.directions(index), attitude))
        found.append(Rays(kind, np.concatenate(origins), _unit(np.concatenate(directions))))
    return found


def _random(scene: Scene, rng: np.random.Generator) -> Rays:
    """Return rays in all directions from the air and from under and within objects."""
    origins = np.repeat(_places(scene, rng, 0.3, 25.0), FROM_EACH, axis=0)
    return Rays("random", origins, _unit(rng.standard_normal(origins.shape)))


def _grazing(scene: Scene, rng: np.random.Generator) -> Rays:
    """Return rays within 3 degrees of level, just above the ground."""
    origins = np.repeat(_places(scene, rng, 0.3, 3.0), FROM_EACH, axis=0)
    azimuth = rng.uniform(-np.pi, np.pi, len(origins))
    elevation = np.radians(rng.uniform(-3.0, 1.0, len(origins)))
    flat = np.cos(elevation)
    directions = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])
    return Rays("grazing", origins, _unit(directions))


def _at_edges(scene: Scene, rng: np.random.Generator) -> Rays:
    """Return rays at the corners of the solids' bounds, off by 2 cm at random."""
    solids = scene.world.solids
    if not solids:
        return Rays("edges", np.empty((0, 3)), np.empty((0, 3)))
    origins = np.repeat(_places(scene, rng, 2.0, 25.0), FROM_EACH, axis=0)
    bounds = np.array([solid.bounds() for solid in solids]).reshape(-1, 2, 3)
    chosen = rng.integers(len(solids), size=len(origins))
    side = rng.integers(3, size=(len(origins), 3))
    low, high = bounds[chosen, 0], bounds[chosen, 1]
    target = np.choose(side, [low, high, (low + high) / 2]) + rng.normal(0.0, 0.02, origins.shape)
    return Rays("edges", origins, _unit(target - origins))


def _vertical(scene: Scene, rng: np.random.Generator) -> Rays:
    """Return rays straight down, half of them at solids."""
    x0, y0, x1, y1 = scene.extent_m
    places = rng.uniform((x0, y0), (x1, y1), (VERTICAL, 2))
    if scene.world.solids:
        bounds = np.array([solid.bounds() for solid in scene.world.solids]).reshape(-1, 2, 3)[:, :, :2]
        chosen = rng.integers(len(bounds), size=VERTICAL // 2)
        places[: VERTICAL // 2] = rng.uniform(bounds[chosen, 0], bounds[chosen, 1])
    origins = np.column_stack([places, np.full(VERTICAL, VERTICAL_FROM_M)])
    return Rays("vertical", origins, np.tile([0.0, 0.0, -1.0], (VERTICAL, 1)))


def _places(scene: Scene, rng: np.random.Generator, low_m: float, high_m: float) -> F64:
    """Return `ORIGINS` places at a height over the ground, whatever stands there."""
    ground = scene.world.ground
    x0, y0, x1, y1 = ground.extent_m
    x = rng.uniform(max(x0, -90.0) + 2.0, min(x1, 90.0) - 2.0, ORIGINS)
    y = rng.uniform(max(y0, -90.0) + 2.0, min(y1, 90.0) - 2.0, ORIGINS)
    return np.column_stack([x, y, heights(ground, x, y) + rng.uniform(low_m, high_m, ORIGINS)])


def _inside(scene: Scene, place: F64) -> tuple[float, float]:
    x0, y0, x1, y1 = scene.extent_m
    return float(np.clip(place[0], x0 + 2, x1 - 2)), float(np.clip(place[1], y0 + 2, y1 - 2))


def _attitude(rng: np.random.Generator) -> F64:
    """Return a quaternion of any heading, tilted by up to 20 degrees."""
    heading, tilt, about = (
        rng.uniform(-np.pi, np.pi),
        np.radians(rng.uniform(0, 20)),
        rng.uniform(0, 2 * np.pi),
    )
    c, s = np.cos(tilt / 2), np.sin(tilt / 2)
    lean = np.array([c, s * np.cos(about), s * np.sin(about), 0.0])
    ch, sh = np.cos(heading / 2), np.sin(heading / 2)
    w, x, y, z = lean
    return np.array([ch * w - sh * z, ch * x - sh * y, ch * y + sh * x, ch * z + sh * w])


def _unit(vectors: F64) -> F64:
    unit: F64 = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit
