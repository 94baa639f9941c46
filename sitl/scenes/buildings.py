"""Scenes of buildings: high ones, flat roofs, a dense town and long walls."""

from __future__ import annotations

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import LAWN_RELIEF_M, MICRO_RELIEF_M, Terrain
from sitl.scenes.scene import Polygon, Scene, rectangle
from sitl.scenes.scene_objects import FOOT_M
from sitl.world.primitives import Box, Cylinder, Kind, Solid
from sitl.world.world import World

ROOFS = 7
PITCH_M = 26.0
HEIGHTS_M = (4.0, 6.0, 8.0, 11.0, 15.0, 20.0, 25.0)
PARAPETS_M = (0.0, 0.3, 0.9)
EDGE_M = 0.5


def build_flat_roofs(seed: int) -> Scene:
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


BLOCK_M, ALLEY_M = 24.0, 4.0
SQUARE = (-42.0, -42.0, 42.0, 42.0)


def build_dense(seed: int) -> Scene:
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


YARD = (-9.0, -14.0, 11.0, 14.0)
PARAPET_M = 0.4


def build_buildings(seed: int) -> Scene:
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
