"""Valley floor between mountains (scene 3, far mode)."""

from __future__ import annotations

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Scene, rectangle
from sitl.world.primitives import Kind, Solid
from sitl.world.world import World

HALF_M = 400.0
VALLEY = (-380.0, -45.0, 380.0, 45.0)


def build(seed: int) -> Scene:
    """Return the valley; mountains rise to about 150 m on both sides, and a river runs along one."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(HALF_M, 1.0, terrain_rng)
    away = np.maximum(np.abs(terrain.y) - 50.0, 0.0)
    terrain.swell(6.0, 160.0)
    terrain.swell(1.0, 30.0)
    terrain.z *= np.clip(away / 60.0, 0.0, 1.0)
    terrain.z += 0.45 * away**2 / (away + 40.0)
    terrain.swell(0.15, 60.0)
    terrain.cover(terrain.z > 30.0, Kind.ROCK, 0.12)
    terrain.level(terrain.rectangle(-15.0, -15.0, 15.0, 15.0), 0.0, 15.0)
    river = terrain.rectangle(-HALF_M, 30.0, HALF_M, 40.0)
    terrain.flood(river, -0.8, 5.0)
    solids: list[Solid] = []
    for k in range(260):
        x, y = rng.uniform(-390.0, 390.0), rng.choice([-1.0, 1.0]) * rng.uniform(48.0, 220.0)
        solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(6.0, 14.0), rng)
    for k in range(80):
        x, y = rng.uniform(-390.0, 390.0), rng.choice([-1.0, 1.0]) * rng.uniform(42.0, 100.0)
        solids += scene_objects.boulder(f"stone-{k}", x, y, terrain.at(x, y), rng.uniform(0.3, 1.5), rng)
    return Scene(
        name="mountains",
        seed=seed,
        world=World(terrain.ground(), solids, cell_m=8.0),
        home_enu=(0.0, 0.0, 0.0),
        description="A grassy valley with a river between wooded and rocky mountain sides",
        regions={
            "valley": rectangle(*VALLEY),
            "river": rectangle(-HALF_M, 30.0, HALF_M, 40.0),
            "north_side": rectangle(-380.0, 120.0, 380.0, 380.0),
            "south_side": rectangle(-380.0, -380.0, 380.0, -120.0),
        },
    )
