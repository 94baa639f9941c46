"""Returns of a LiDAR over a frozen scene: rays, noise, dust, multipath and water that answers nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from companion.desk.open_benchmark.footprint_truth import NODES, PITCH_M
from companion.desk.open_benchmark.frozen_scenes import HALF_M, WATER, FrozenScene
from companion.desk.open_benchmark.hazard_shapes import Cable
from companion.desk.open_benchmark.landing_task import F64, FlownReturns

WINDOWS = 5
NOISE_M = 0.02
STEP_M = 0.01  # along a ray where a surface may be near
REACHES_M = (0.5, 0.1)  # half sides of the squares whose greatest height lets a ray go on
RESOLUTION_M = 0.001  # of the coordinates, as in the LAZ files
BISECTIONS = 12


def sensor_places() -> F64:
    """Return (windows, 3) places of the sensor: a climbing pass over the scene, one place a second."""
    k = np.linspace(-1.0, 1.0, WINDOWS)
    return np.stack([6.0 * k, 4.0 * k, 25.0 + 3.0 * k], axis=1)


def scan(scene: FrozenScene, per_m2: int, surface_m: F64) -> FlownReturns:
    """Return the returns of a flight with a density of pulses (per m²).

    Pulses are aimed at random points of the scene. Ranges have normal noise; of the scene's share of clutter
    half is dust anywhere on the way, the rest up to 2 m before or behind the surface. Wires return what hits
    them, water nothing.

    Parameters
    ----------
    surface_m
        Heights of the lattice of `footprint_truth`.
    """
    rng = np.random.default_rng([scene.seed, per_m2])
    caster = RayCaster(surface_m)
    n = round(per_m2 * (2 * HALF_M) ** 2 / WINDOWS)
    points, stamps, windows = [], [], []
    sensors = sensor_places()
    for k, sensor in enumerate(sensors):
        aims = np.column_stack([rng.uniform(-HALF_M, HALF_M, (n, 2)), np.zeros(n)])
        direction = aims - sensor
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        range_m = _with_cables(caster.cast(sensor, direction), sensor, direction, scene.cables)
        range_m[_on_water(scene, sensor + range_m[:, None] * direction)] = np.nan
        noisy = range_m + rng.normal(0.0, NOISE_M, n)
        noisy = _with_clutter(noisy, range_m, scene.clutter, rng)
        hit = np.isfinite(noisy)
        points.append(sensor + noisy[hit, None] * direction[hit])
        stamps.append(k + np.linspace(0.0, 0.9, n)[hit])
        windows.append(np.full(int(hit.sum()), k, np.int64))
    rounded = np.rint(np.concatenate(points) / RESOLUTION_M) * RESOLUTION_M
    return FlownReturns(rounded, np.concatenate(stamps).round(6), np.concatenate(windows), sensors)


class RayCaster:
    """Ray caster over the bilinear surface of a lattice."""

    def __init__(self, surface_m: F64) -> None:
        self._z = surface_m
        self._top = float(surface_m.max()) + 0.05
        size = [2 * round(reach / PITCH_M) + 1 for reach in REACHES_M]
        self._highest = [maximum_filter(surface_m, s, mode="nearest") for s in size]

    def cast(self, sensor: F64, direction: F64) -> F64:
        """Return the range (n,) of rays that point down; NaN where one leaves the lattice.

        A step is as long as the greatest height around allows, at least 1 cm; a ray that is below the surface
        halves its last step.
        """
        out = np.full(len(direction), np.nan)
        alive = np.arange(len(direction))
        far = (self._top - sensor[2]) / direction[:, 2]
        step = np.zeros(len(direction))
        flat = np.maximum(np.hypot(direction[:, 0], direction[:, 1]), 1e-9)
        while len(alive):
            at = sensor + far[alive, None] * direction[alive]
            row, col, inside = _index(at)
            alive, at, row, col = alive[inside], at[inside], row[inside], col[inside]
            under = at[:, 2] <= self._height(at)
            struck = alive[under]
            out[struck] = self._halved(sensor, direction[struck], far[struck] - step[struck], far[struck])
            alive, at, row, col = alive[~under], at[~under], row[~under], col[~under]
            onward = np.full(len(alive), STEP_M)
            for highest, reach in zip(self._highest[::-1], REACHES_M[::-1], strict=True):
                free = at[:, 2] - highest[row, col]
                allowed = np.minimum(free / -direction[alive, 2], (reach - 2 * PITCH_M) / flat[alive])
                onward = np.maximum(onward, allowed)
            step[alive] = onward
            far[alive] += onward
        return out

    def _height(self, at: F64) -> F64:
        row, col, _ = _index(at)
        u, v = at[:, 0] / PITCH_M + NODES // 2 - col, at[:, 1] / PITCH_M + NODES // 2 - row
        z = self._z
        low = (1 - u) * z[row, col] + u * z[row, col + 1]
        return np.asarray((1 - v) * low + v * ((1 - u) * z[row + 1, col] + u * z[row + 1, col + 1]))

    def _halved(self, sensor: F64, direction: F64, near: F64, far: F64) -> F64:
        """Return the range where a ray enters the surface, between one above and one below it."""
        near = np.maximum(near, 0.0)
        for _ in range(BISECTIONS):
            middle = (near + far) / 2
            at = sensor + middle[:, None] * direction
            _, _, inside = _index(at)
            under = np.zeros(len(at), bool)
            under[inside] = at[inside, 2] <= self._height(at[inside])
            near, far = np.where(under, near, middle), np.where(under, middle, far)
        return far


def _index(at: F64) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Return the south-west node of each point's square, and whether the lattice has it."""
    col = np.floor(at[:, 0] / PITCH_M).astype(np.int64) + NODES // 2
    row = np.floor(at[:, 1] / PITCH_M).astype(np.int64) + NODES // 2
    return row, col, (row >= 0) & (col >= 0) & (row < NODES - 1) & (col < NODES - 1)


def _with_cables(range_m: F64, sensor: F64, direction: F64, cables: tuple[Cable, ...]) -> F64:
    """Return the ranges, shortened where a ray passes a wire within its radius."""
    out = range_m.copy()
    for cable in cables:
        start = np.array(cable.from_m)
        axis = np.array(cable.to_m) - start
        length = float(np.linalg.norm(axis))
        axis /= length
        normal = np.cross(direction, axis)
        squared = np.maximum((normal**2).sum(axis=1), 1e-18)
        away = start - sensor
        gap = np.abs(normal @ away) / np.sqrt(squared)
        along_ray = (np.cross(away, axis) * normal).sum(axis=1) / squared
        along_wire = (np.cross(away, direction) * normal).sum(axis=1) / squared
        hit = (gap <= cable.radius_m) & (along_wire >= 0) & (along_wire <= length) & (along_ray > 0)
        hit &= ~(along_ray > out)  # a ray that leaves the scene may strike a wire before
        out[hit] = along_ray[hit]
    return out


def _on_water(scene: FrozenScene, at: F64) -> NDArray[np.bool_]:
    x, y = at[:, 0], at[:, 1]
    wet = np.zeros(len(at), bool)
    for shape in scene.shapes:
        if shape.kind == WATER:
            wet |= shape.rise_m(x, y) != 0.0
    return wet


def _with_clutter(noisy_m: F64, range_m: F64, share: float, rng: np.random.Generator) -> F64:
    """Return the ranges, some replaced by those of dust or of multipath."""
    out = noisy_m.copy()
    bad = (rng.random(len(out)) < share) & np.isfinite(range_m)
    sort, depth, near = rng.random((3, len(out)))
    dust = 2.0 + depth * (range_m - 2.0)
    about = range_m + np.where(sort < 0.75, -1.0, 1.0) * (0.1 + 1.9 * near)
    out[bad] = np.where(sort < 0.5, dust, about)[bad]
    return out
