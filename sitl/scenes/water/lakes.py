"""Two lakes with sandy shores and a belt of reed, in any wind; the start is on the shore of one."""

from __future__ import annotations

import math

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Scene, ellipse, rectangle
from sitl.world.primitives import Kind, Solid
from sitl.world.surface_layers import MEADOW, REED
from sitl.world.water_waves import WaterState

LAKES = ((55.0, 10.0, 38.0, 25.0), (-75.0, -60.0, 20.0, 13.0))
"""East, north and radii of the level bottoms; the shores are about 9 m farther out."""
LEVEL_M, BOTTOM_M, SHORE_M = -1.0, -3.5, 14.0
WIND_MS, TURBIDITY = (1.0, 12.0), (0.0, 0.03)
"""Ranges from which a seed draws; turbidity up to that of muddy water, see ``WaterState.turbid``."""


def build(seed: int) -> Scene:
    """Return the lakes; the seed sets relief, trees, wind and turbidity."""
    terrain_rng, rng, water_rng = np.random.default_rng(seed).spawn(3)
    wind_ms, turbid = water_rng.uniform(*WIND_MS), water_rng.uniform(*TURBIDITY)
    water = WaterState(wind_ms=float(wind_ms), fetch_m=90.0, turbid=float(turbid))
    terrain = Terrain(150.0, 0.5, terrain_rng)
    terrain.swell(0.25, 80.0)
    terrain.level(terrain.rectangle(-10.0, 0.0, 3.0, 20.0), 0.0, 10.0)
    terrain.grow(terrain.rectangle(-120.0, 20.0, -30.0, 120.0), MEADOW)
    for x, y, a, b in LAKES:
        terrain.level(terrain.ellipse(x, y, a, b), BOTTOM_M, SHORE_M)
        around = terrain.ellipse(x, y, a + SHORE_M, b + SHORE_M)
        terrain.cover(around & (terrain.z < -0.5), Kind.SAND)
        terrain.stand_water(around, LEVEL_M)
    x, y, _, _ = LAKES[0]
    belt = (terrain.z < LEVEL_M + 0.1) & (terrain.z > LEVEL_M - 0.6)
    terrain.grow(belt & (np.arctan2(terrain.y - y, terrain.x - x) > 0.6) & (terrain.x > x - 30.0), REED)
    solids: list[Solid] = []
    for k in range(60):
        px, py = rng.uniform(-140.0, 140.0, 2)
        if terrain.at(px, py) > -0.6 and math.hypot(px, py - 10.0) > 25.0:
            solids += scene_objects.tree(f"tree-{k}", px, py, terrain.at(px, py), rng.uniform(4.0, 10.0), rng)
    return Scene(
        name="lakes",
        seed=seed,
        world=terrain.world(solids, water=water),
        home_enu=(0.0, 10.0, 0.0),
        description=f"Two lakes with sandy shores, reed, meadows and trees, in a wind of {wind_ms:.0f} m/s",
        regions={
            **{f"lake-{k}": ellipse(x, y, a + 7.0, b + 7.0) for k, (x, y, a, b) in enumerate(LAKES, 1)},
            "meadow": rectangle(-120.0, 20.0, -30.0, 120.0),
        },
    )
