"""Two flat-roofed buildings with a level yard between them (landing points, SLZ thesis, section 4.4.5)."""

from __future__ import annotations

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import LAWN_RELIEF_M, Terrain
from sitl.scenes.scene import Polygon, Scene, rectangle
from sitl.world.primitives import Kind, Solid
from sitl.world.world import World

YARD = (-9.0, -14.0, 11.0, 14.0)
PARAPET_M = 0.4


def build(seed: int) -> Scene:
    """Return the yard; the seed sets length, depth and height of both buildings and moves the far trees."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(70.0, 0.5, terrain_rng)
    terrain.swell(0.3, 60.0)
    terrain.level(terrain.rectangle(-36.0, -36.0, 36.0, 36.0), 0.0, 15.0)
    terrain.cover(terrain.rectangle(*YARD), Kind.GRASS, LAWN_RELIEF_M)
    solids: list[Solid] = []
    regions: dict[str, Polygon] = {"yard": rectangle(*YARD)}
    for side, wall_x in (("west", YARD[0]), ("east", YARD[2])):
        depth, length = float(rng.uniform(9.0, 14.0)), float(rng.uniform(15.0, 26.0))
        height = float(rng.uniform(5.0, 11.0))
        x, y = wall_x + (0.5 if side == "east" else -0.5) * depth, float(rng.uniform(-3.0, 3.0))
        solids += scene_objects.flat_roof(side, x, y, 0.0, (depth, length, height), PARAPET_M)
        regions[f"building_{side}"] = rectangle(x - depth / 2, y - length / 2, x + depth / 2, y + length / 2)
    for k in range(12):
        turn, away = 2 * np.pi * k / 12 + rng.uniform(-0.2, 0.2), rng.uniform(46.0, 62.0)
        x, y = float(away * np.cos(turn)), float(away * np.sin(turn))
        solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(4.0, 9.0), rng)
    return Scene(
        name="buildings",
        seed=seed,
        world=World(terrain.ground(), solids),
        home_enu=(1.0, 0.0, 0.0),
        description="Two flat-roofed buildings, a level yard between them, trees far around",
        regions=regions,
    )
