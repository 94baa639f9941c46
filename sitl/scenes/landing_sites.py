"""Scenes of landing sites: a car park, wet or dry, and a site with a ridge, a pond and rocks."""

from __future__ import annotations

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Polygon, Scene, ellipse, rectangle
from sitl.world.primitives import Box, Ellipsoid, Kind, Solid
from sitl.world.water_waves import WaterState
from sitl.world.world import World

AREA = (-45.0, -45.0, 45.0, 45.0)
FALL = 0.015
"""Slope of the asphalt, down to the south."""
POOL = (18.0, -34.0, 7.0, 0.28)
"""East, north, radius and depth of the dip over the blocked drain."""
DIPS = 40
WATER = WaterState(wind_ms=0.0)


def build_wet(seed: int) -> Scene:
    """Return the car park after rain."""
    return _build(seed, wet=True)


def build_dry(seed: int) -> Scene:
    """Return the car park in dry weather."""
    return _build(seed, wet=False)


def _build(seed: int, wet: bool) -> Scene:
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(60.0, 0.25, terrain_rng)
    terrain.swell(0.004, 12.0)
    terrain.z += FALL * terrain.y
    area = terrain.rectangle(*AREA)
    terrain.cover(area, Kind.WET_ASPHALT if wet else Kind.ASPHALT)
    dips = [POOL]
    for _ in range(DIPS):
        x, y = rng.uniform(-42.0, 42.0, 2)
        radius = float(rng.uniform(0.8, 2.2))
        dips.append((float(x), float(y), radius, FALL * radius + float(rng.uniform(0.01, 0.03))))
    for x, y, radius, deep in dips:
        _dip(terrain, x, y, radius, deep, wet)
    solids: list[Solid] = []
    for row, y in enumerate((-36.0, -20.0, 22.0, 38.0)):
        for k, x in enumerate(np.arange(-42.0, 43.0, 2.8)):
            lean, free = float(0.5 * np.pi + rng.normal(0.0, 0.03)), rng.random() < 0.45
            if not free and np.hypot(x - POOL[0], y - POOL[1]) > POOL[2] + 3.0:
                z = terrain.at(float(x), y)
                solids += scene_objects.parked_car(f"parked-{row}-{k}", float(x), y, z, lean)
    for k, x in enumerate((-30.0, 0.0, 30.0)):
        solids += scene_objects.lamp(f"lamp-{k}", x, 30.0, terrain.at(x, 30.0), 8.0)
    weather = "after rain, a film of water, puddles and a pool" if wet else "in dry weather"
    return Scene(
        name=f"car_park_{'wet' if wet else 'dry'}",
        seed=seed,
        world=terrain.world(solids, water=WATER),
        home_enu=(0.0, 2.0, 0.0),
        description=f"Asphalt car park that drains by 1.5 %, {weather}",
        regions={"car_park": rectangle(*AREA), "pool": ellipse(POOL[0], POOL[1] - 1.5, 3.0, 2.5)},
    )


def _dip(terrain: Terrain, x: float, y: float, radius: float, deep: float, wet: bool) -> None:
    """Dig a bowl, and fill it up to the lower edge of its rim."""
    way = np.hypot(terrain.x - x, terrain.y - y) / radius
    inside = way < 1.0
    level = FALL * (y - radius)
    terrain.z[inside] -= deep * (1.0 - way[inside] ** 2) ** 2
    if wet:
        terrain.stand_water(inside, level - 0.002)


HALF_M = 50.0
"""Half side of the surveyed area."""
POND = (-30.0, -32.0, 10.0, 7.0)
RIDGE = (30.0, 22.0, 9.0)
"""East, north and half width of a ridge with flanks of 22 degrees."""


def build_landing_site(seed: int) -> Scene:
    """Return 100 m x 100 m of water, sand, soil, grass and snow; the seed moves its objects."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(100.0, 0.5, terrain_rng)
    terrain.swell(0.25, 60.0)
    terrain.cover(terrain.rectangle(-100, 10, -10, 100), Kind.SOIL)
    terrain.cover(terrain.rectangle(-100, -100, -5, -12), Kind.SAND)
    terrain.cover(terrain.rectangle(8, -100, 100, -15), Kind.SNOW)
    _ridge(terrain)
    terrain.flood(terrain.ellipse(*POND), terrain.at(POND[0], POND[1]), 4.0)
    return Scene(
        name="landing_site",
        seed=seed,
        world=World(terrain.ground(), _things(terrain, rng)),
        home_enu=(0.0, 0.0, 0.0),
        description="Water, sand, soil, grass and snow with boulders, crates and a ridge",
        regions={
            "site": rectangle(-HALF_M, -HALF_M, HALF_M, HALF_M),
            "pond": ellipse(*POND),
            "ridge": _flanks(),
        },
    )


def _ridge(terrain: Terrain) -> None:
    x, y, half = RIDGE
    away = np.abs(terrain.x - x)
    length = np.clip((14.0 - np.abs(terrain.y - y)) / 4.0, 0.0, 1.0)
    terrain.z += np.tan(np.radians(22.0)) * np.maximum(half - away, 0.0) * length


def _flanks() -> Polygon:
    x, y, half = RIDGE
    return rectangle(x - half + 1, y - 9.0, x + half - 1, y + 9.0)


def _things(terrain: Terrain, rng: np.random.Generator) -> list[Solid]:
    """Scatter boulders and crates from 0.5 m to 1.6 m high, 1.5 m to 3 m wide, on a jittered lattice."""
    solids: list[Solid] = []
    for y in np.arange(-42.0, 43.0, 12.0):
        for x in np.arange(-42.0, 43.0, 12.0):
            px, py = float(x + rng.uniform(-2, 2)), float(y + rng.uniform(-2, 2))
            size, height = rng.uniform(1.5, 3.0), rng.uniform(0.5, 1.6)
            wet = ((px - POND[0]) / (POND[2] + 4)) ** 2 + ((py - POND[1]) / (POND[3] + 4)) ** 2 < 1
            steep = abs(px - RIDGE[0]) < RIDGE[2] + 3 and abs(py - RIDGE[1]) < 17
            if rng.random() < 0.45 or wet or steep:
                continue
            z = terrain.at(px, py)
            name = f"{len(solids)}-{height:.2f}"
            if rng.random() < 0.5:
                yaw = rng.uniform(0, np.pi)
                crate = Box(px, py, z - 0.3, size, size, height + 0.3, yaw, Kind.WOOD, f"crate-{name}")
                solids.append(crate)
            else:
                r = size / 2
                solids.append(Ellipsoid(px, py, z, r, r, height, Kind.ROCK, f"boulder-{name}"))
    return solids
