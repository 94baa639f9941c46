"""Sheltered fish ponds without wind; the start is on the dam between two of them."""

from __future__ import annotations

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Scene, rectangle
from sitl.world.primitives import Kind, Solid
from sitl.world.surface_layers import REED
from sitl.world.water_waves import WaterState

PONDS = (
    (-52.0, -20.0, -10.0, 20.0, -0.6, 1.6),
    (10.0, -20.0, 52.0, 20.0, -0.9, 0.9),
    (-30.0, 36.0, 30.0, 62.0, -0.4, 0.25),
)
"""West, south, east and north of each level bottom; level of its water, and greatest depth."""
BANK_M = 3.0
WATER = WaterState(wind_ms=0.0)


def build(seed: int) -> Scene:
    """Return the ponds; the seed sets relief and trees."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(100.0, 0.5, terrain_rng)
    terrain.swell(0.12, 50.0)
    terrain.level(terrain.rectangle(-5.5, -30.0, 5.5, 30.0), 0.0, 4.0)
    regions = {"dam": rectangle(-5.5, -25.0, 5.5, 25.0)}
    for k, (x0, y0, x1, y1, level, deep) in enumerate(PONDS, 1):
        terrain.level(terrain.rectangle(x0, y0, x1, y1), level - deep, BANK_M)
        around = terrain.rectangle(x0 - BANK_M, y0 - BANK_M, x1 + BANK_M, y1 + BANK_M)
        terrain.cover(around & (terrain.z < level + 0.1), Kind.SOIL, 0.01)
        terrain.stand_water(around, level)
        regions[f"pond-{k}"] = rectangle(x0, y0, x1, y1)
    terrain.grow(terrain.rectangle(-52.0, 12.0, -30.0, 20.0), REED)
    solids: list[Solid] = []
    for k in range(40):
        turn, away = rng.uniform(0.0, 2 * np.pi), rng.uniform(76.0, 95.0)
        x, y = float(away * np.cos(turn)), float(away * np.sin(turn))
        solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(5.0, 12.0), rng)
    return Scene(
        name="ponds",
        seed=seed,
        world=terrain.world(solids, water=WATER),
        home_enu=(0.0, 0.0, 0.0),
        description="Three calm ponds 0.25 m to 1.6 m deep, a dam between two, reed, trees around",
        regions=regions,
    )
