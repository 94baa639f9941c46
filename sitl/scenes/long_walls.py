"""Long straight walls on level ground: nothing tells a LiDAR how far along them it is."""

from __future__ import annotations

import numpy as np

from sitl.scenes.ground import LAWN_RELIEF_M, Terrain
from sitl.scenes.scene import Scene, rectangle
from sitl.scenes.scene_objects import FOOT_M
from sitl.world.primitives import Box, Kind, Solid

HALF_M, LENGTH_M, THICK_M = 110.0, 200.0, 0.4
CORRIDOR_HALF_M, CORRIDOR_HEIGHT_M = 10.0, 8.0
WALL_NORTH_M, WALL_HEIGHT_M = 12.0, 6.0


def build_corridor(seed: int) -> Scene:
    """Return two parallel walls 20 m apart along east and west; the seed sets the micro relief alone."""
    side_m = CORRIDOR_HALF_M + THICK_M / 2
    return _scene(
        "corridor",
        seed,
        [_wall("north", side_m, CORRIDOR_HEIGHT_M), _wall("south", -side_m, CORRIDOR_HEIGHT_M)],
        "Two parallel walls of 200 m, 8 m high and 20 m apart, with a level lawn between them",
        (-LENGTH_M / 2, -CORRIDOR_HALF_M, LENGTH_M / 2, CORRIDOR_HALF_M),
    )


def build_wall(seed: int) -> Scene:
    """Return one wall along east and west, 12 m north of the start; the seed sets the micro relief alone."""
    return _scene(
        "wall",
        seed,
        [_wall("north", WALL_NORTH_M + THICK_M / 2, WALL_HEIGHT_M)],
        "One wall of 200 m, 6 m high, on a level lawn",
        (-LENGTH_M / 2, -WALL_NORTH_M, LENGTH_M / 2, WALL_NORTH_M),
    )


def _wall(name: str, north_m: float, height_m: float) -> Solid:
    return Box(
        0.0, north_m, -FOOT_M, LENGTH_M, THICK_M, height_m + FOOT_M, kind=Kind.CONCRETE, name=f"wall-{name}"
    )


def _scene(
    name: str,
    seed: int,
    walls: list[Solid],
    description: str,
    beside: tuple[float, float, float, float],
) -> Scene:
    terrain = Terrain(HALF_M, 0.5, np.random.default_rng(seed))
    terrain.cover(np.ones_like(terrain.z, dtype=bool), Kind.GRASS, LAWN_RELIEF_M)
    return Scene(
        name=name,
        seed=seed,
        world=terrain.world(walls),
        home_enu=(0.0, 0.0, 0.0),
        description=description,
        regions={"lawn": rectangle(*beside)},
    )
