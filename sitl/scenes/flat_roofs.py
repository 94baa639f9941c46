"""Flat roofs in a row: gravel and bitumen, 4 m to 25 m high, with and without a parapet."""

from __future__ import annotations

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import LAWN_RELIEF_M, Terrain
from sitl.scenes.scene import Polygon, Scene, rectangle
from sitl.world.primitives import Kind, Solid

ROOFS = 7
PITCH_M = 26.0
HEIGHTS_M = (4.0, 6.0, 8.0, 11.0, 15.0, 20.0, 25.0)
PARAPETS_M = (0.0, 0.3, 0.9)
EDGE_M = 0.5


def build(seed: int) -> Scene:
    """Return the row; the seed sets sizes, the order of heights, coverings and parapets, and the relief."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(120.0, 0.5, terrain_rng)
    terrain.swell(0.25, 60.0)
    terrain.z += 0.01 * terrain.x
    road = terrain.rectangle(-120.0, -26.0, 120.0, -18.0)
    terrain.cover(road, Kind.ASPHALT)
    terrain.cover(terrain.rectangle(-12.0, -52.0, 12.0, -30.0), Kind.GRASS, LAWN_RELIEF_M)
    solids: list[Solid] = []
    regions: dict[str, Polygon] = {"road": rectangle(-115.0, -26.0, 115.0, -18.0)}
    heights = rng.permutation(HEIGHTS_M)
    for k in range(ROOFS):
        x, height = (k - (ROOFS - 1) / 2) * PITCH_M, float(heights[k])
        length, width = float(rng.uniform(13.0, 20.0)), float(rng.uniform(13.0, 22.0))
        kind = Kind.GRAVEL if rng.random() < 0.5 else Kind.BITUMEN
        parapet = float(rng.choice(PARAPETS_M))
        size = (length, width, height)
        name = f"roof-{k + 1}"
        solids += scene_objects.flat_roof(name, x, 0.0, terrain.at(x, 0.0), size, parapet, kind)
        reach_x, reach_y = length / 2 - EDGE_M, width / 2 - EDGE_M
        regions[name] = rectangle(x - reach_x, -reach_y, x + reach_x, reach_y)
    for k in range(14):
        x, y = rng.uniform(-110.0, 110.0), float(rng.uniform(40.0, 100.0))
        solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(5.0, 10.0), rng)
    return Scene(
        name="flat_roofs",
        seed=seed,
        world=terrain.world(solids),
        home_enu=(0.0, -41.0, 0.0),
        description="Seven flat roofs of gravel and bitumen in a row, 4 m to 25 m high, a road and lawns",
        regions=regions,
    )
