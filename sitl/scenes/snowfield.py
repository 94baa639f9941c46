"""Snow with drifts over undulating ground, a cleared yard, a hut and stones."""

from __future__ import annotations

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Scene, rectangle
from sitl.world.primitives import Kind, Solid
from sitl.world.surface_layers import SNOW

YARD = (-10.0, -10.0, 10.0, 10.0)


def build(seed: int) -> Scene:
    """Return the snowfield; the seed sets drifts, stones and trees."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(100.0, 0.5, terrain_rng)
    terrain.swell(0.6, 60.0)
    terrain.swell(0.06, 12.0)
    terrain.level(terrain.rectangle(*YARD), 0.0, 8.0)
    terrain.cover(np.ones_like(terrain.z, dtype=bool), Kind.SNOW)
    terrain.cover(terrain.rectangle(*YARD), Kind.ASPHALT)
    terrain.grow(~terrain.rectangle(*YARD), SNOW)
    solids: list[Solid] = list(
        scene_objects.flat_roof("hut", 24.0, 16.0, terrain.at(24.0, 16.0), (8.0, 6.0, 3.0), 0.0, Kind.SNOW)
    )
    for k in range(25):
        x, y = rng.uniform(-90.0, 90.0), rng.uniform(-45.0, -25.0)
        solids += scene_objects.boulder(f"stone-{k}", x, y, terrain.at(x, y), rng.uniform(0.4, 1.2), rng)
    for k in range(30):
        x, y = rng.uniform(-90.0, 90.0), rng.uniform(35.0, 95.0)
        solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(4.0, 9.0), rng)
    return Scene(
        name="snowfield",
        seed=seed,
        world=terrain.world(solids),
        home_enu=(0.0, 0.0, 0.0),
        description="Snow with drifts, stones, trees, a hut, and a cleared yard of asphalt",
        regions={"yard": rectangle(*YARD), "snow": rectangle(-90.0, -20.0, 90.0, -12.0)},
    )
