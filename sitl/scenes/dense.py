"""Dense buildings of many heights with narrow gaps, one square and a few bare roofs (scene 4)."""

from __future__ import annotations

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import MICRO_RELIEF_M, Terrain
from sitl.scenes.scene import Polygon, Scene, rectangle
from sitl.world.primitives import Box, Cylinder, Kind, Solid
from sitl.world.world import World

BLOCK_M, ALLEY_M = 24.0, 4.0
SQUARE = (-42.0, -42.0, 42.0, 42.0)


def build(seed: int) -> Scene:
    """Return the dense quarter; the seed sets heights, rooftop equipment and the choice of bare roofs."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(128.0, 0.5, terrain_rng)
    terrain.cover(np.ones_like(terrain.z, dtype=bool), Kind.ASPHALT)
    terrain.cover(terrain.rectangle(*SQUARE), Kind.PAVING, MICRO_RELIEF_M[Kind.PAVING])
    solids: list[Solid] = []
    regions: dict[str, Polygon] = {"square": rectangle(*SQUARE)}
    pitch = BLOCK_M + ALLEY_M
    for row in range(-4, 5):
        for column in range(-4, 5):
            x, y = column * pitch, row * pitch
            if abs(x) < 29.0 and abs(y) < 29.0:
                continue
            name, height = f"house{row:+d}{column:+d}", float(rng.uniform(6.0, 32.0))
            size = (float(rng.uniform(19.0, BLOCK_M)), float(rng.uniform(19.0, BLOCK_M)), height)
            solids += scene_objects.flat_roof(name, x, y, 0.0, size, 0.6)
            if rng.random() < 0.25:
                regions[f"roof{row:+d}{column:+d}"] = rectangle(x - 8.0, y - 8.0, x + 8.0, y + 8.0)
            else:
                solids += _roof_plant(name, x, y, height, rng)
    for k, (x, y) in enumerate(((-26.0, -26.0), (26.0, -26.0), (-26.0, 26.0), (26.0, 26.0))):
        solids += scene_objects.lamp(f"lamp-{k}", x, y, 0.0, 5.0)
    solids += scene_objects.tree("tree-square", -20.0, 18.0, 0.0, 7.0, rng)
    solids += scene_objects.parked_car("parked-0", 18.0, -22.0, 0.0, 0.4)
    return Scene(
        name="dense",
        seed=seed,
        world=World(terrain.ground(), solids),
        home_enu=(0.0, 0.0, 0.0),
        description="Flat-roofed buildings 6-32 m high, alleys of 4-9 m, one square",
        regions=regions,
    )


def _roof_plant(name: str, x: float, y: float, top: float, rng: np.random.Generator) -> list[Solid]:
    solids: list[Solid] = []
    for k in range(int(rng.integers(3, 7))):
        px, py = x + rng.uniform(-7.0, 7.0), y + rng.uniform(-7.0, 7.0)
        size = rng.uniform(1.0, 4.0, 2)
        high = rng.uniform(0.6, 2.5)
        solids.append(Box(px, py, top, size[0], size[1], high, kind=Kind.METAL, name=f"{name}-plant{k}"))
    mast_x, mast_y = x + rng.uniform(-8.0, 8.0), y + rng.uniform(-8.0, 8.0)
    solids.append(Cylinder(mast_x, mast_y, top, 0.03, 3.0, Kind.METAL, f"{name}-mast"))
    return solids
