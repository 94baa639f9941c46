"""Car park after rain, and its dry twin: asphalt that drains by 1.5 %, with dips and one blocked drain.

After rain a film of water covers the asphalt, the dips hold puddles of centimetres, in which a vehicle can
land, and a pool stands over the drain, in which it cannot. Cars, relief and dips of a seed are the same in
both.
"""

from __future__ import annotations

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Scene, ellipse, rectangle
from sitl.world.primitives import Kind, Solid
from sitl.world.water_waves import WaterState

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
