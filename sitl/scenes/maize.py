"""Maize, wheat, a meadow and bare soil about a grass track, on ground that undulates."""

from __future__ import annotations

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Scene, rectangle
from sitl.world.primitives import Kind, Solid
from sitl.world.surface_layers import MAIZE, MEADOW, WHEAT

TRACK_HALF_M = 6.5
MAIZE_FIELD = (-80.0, TRACK_HALF_M, 60.0, 80.0)
WHEAT_FIELD = (-80.0, -80.0, -5.0, -TRACK_HALF_M)
MEADOW_FIELD = (10.0, -80.0, 60.0, -TRACK_HALF_M)
BARE_FIELD = (65.0, -80.0, 110.0, 80.0)


def build(seed: int) -> Scene:
    """Return the fields; the seed sets relief and trees."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(120.0, 0.5, terrain_rng)
    terrain.swell(0.5, 70.0)
    terrain.swell(0.05, 10.0)
    for field, plants in ((MAIZE_FIELD, MAIZE), (WHEAT_FIELD, WHEAT), (MEADOW_FIELD, MEADOW)):
        terrain.cover(terrain.rectangle(*field), Kind.SOIL)
        terrain.grow(terrain.rectangle(*field), plants)
    terrain.cover(terrain.rectangle(*BARE_FIELD), Kind.SOIL)
    solids: list[Solid] = []
    for k in range(16):
        x, y = float(rng.uniform(-115.0, -90.0)), float(rng.uniform(-110.0, 110.0))
        solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(5.0, 10.0), rng)
    return Scene(
        name="maize",
        seed=seed,
        world=terrain.world(solids),
        home_enu=(0.0, 0.0, 0.5 * np.pi),
        description="Fields of maize 2 m and wheat 0.7 m high, a meadow and bare soil, a grass track between",
        regions={
            "maize": rectangle(*MAIZE_FIELD),
            "wheat": rectangle(*WHEAT_FIELD),
            "meadow": rectangle(*MEADOW_FIELD),
            "bare": rectangle(*BARE_FIELD),
            "track": rectangle(-80.0, -TRACK_HALF_M + 0.5, 60.0, TRACK_HALF_M - 0.5),
        },
    )
