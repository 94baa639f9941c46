"""Main scene: a stadium at a street, with two flat roofs, a pond, a hill and rough ground.

Sizes of the court (106 x 73 m) and of the entrance (55 x 62 m) are those of the SLZ paper's scene 1.
"""

from __future__ import annotations

import math

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import LAWN_RELIEF_M, Terrain
from sitl.scenes.scene import Polygon, Scene, ellipse, rectangle
from sitl.world.primitives import Box, Cylinder, Kind, Solid, Wire
from sitl.world.world import World

KERB_M = 0.15
COURT = (-93.0, 3.5, 13.0, 76.5)
PLAZA = (40.0, -52.5, 95.0, 9.5)
SIDES = {"north": (16, 14.0), "south": (12, 10.0), "west": (10, 8.0), "east": (10, 8.0)}
"""Rows of the stand along each side of the court, and its height."""
STREET = (-200.0, -64.5, 200.0, -55.5)
PAVEMENT_M = 3.0
LARGE_ROOF = (120.0, 25.0, 180.0, 65.0)
SMALL_ROOF = (135.0, -40.0, 165.0, -12.0)
LARGE_ROOF_HEIGHT_M, SMALL_ROOF_HEIGHT_M = 12.0, 8.0
POND = (-120.0, -125.0, 24.0, 16.0)
HILL = (125.0, -140.0, 14.0, 28.0)
RUBBLE = (-25.0, -150.0, 20.0, -115.0)
CAR_PARK = (32.0, 14.0, 112.0, 94.0)
# Trees fill the rest between street and stadium: only court and entrance contain a free square of 24 m there.
GROVES = (
    (-125.0, -50.0, 34.0, -10.0),
    (-125.0, -8.0, -106.0, 98.0),
    (-106.0, 95.0, 196.0, 103.0),
    (114.0, 67.0, 196.0, 92.0),
    (113.0, -50.0, 133.0, 22.0),
    (134.0, -8.0, 180.0, 22.0),
    (166.0, -50.0, 194.0, -8.0),
    (183.0, -8.0, 194.0, 66.0),
)
MEADOW = (-190.0, 120.0, 40.0, 190.0)


def build(seed: int) -> Scene:
    """Return the stadium scene; the seed moves trees, cars, stones and relief, not the layout."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = _terrain(terrain_rng)
    solids = [
        *_stands(),
        *scene_objects.goal("goal-west", COURT[0] + 3.0, 40.0, 0.0, 1.0),
        *scene_objects.goal("goal-east", COURT[2] - 3.0, 40.0, 0.0, -1.0),
        *_street(rng),
        *_plaza(),
        *_roofs(),
        *scene_objects.car_park("car-park", CAR_PARK, 17.0, rng),
        *(
            tree
            for k, area in enumerate(GROVES)
            for tree in scene_objects.grove(f"grove-{k}", area, 18.0, rng)
        ),
        *_park(terrain, rng),
        *_power_line(terrain),
    ]
    return Scene(
        name="stadium",
        seed=seed,
        world=World(terrain.ground(), solids),
        home_enu=(67.0, -22.0, 0.0),
        description="Stadium, entrance, street, two flat roofs, car park, trees, pond, hill, rubble",
        regions=_regions(),
    )


def _terrain(rng: np.random.Generator) -> Terrain:
    terrain = Terrain(200.0, 0.5, rng)
    terrain.swell(0.8, 90.0)
    terrain.hill(*HILL)
    terrain.z += 0.05 * np.maximum(terrain.y - 110.0, 0.0)
    built = terrain.rectangle(-130.0, -70.0, 200.0, 108.0) | terrain.rectangle(-200.0, -70.0, 200.0, -50.0)
    terrain.level(built, 0.0, 25.0)
    terrain.cover(terrain.rectangle(*COURT), Kind.GRASS, LAWN_RELIEF_M)
    terrain.cover(terrain.rectangle(*STREET), Kind.ASPHALT)
    terrain.cover(terrain.rectangle(36.0, -52.5, 112.0, 94.0), Kind.ASPHALT)
    terrain.cover(terrain.rectangle(*RUBBLE), Kind.ROCK)
    x, y, radius_x, radius_y = POND
    terrain.flood(terrain.ellipse(x, y, radius_x, radius_y), terrain.at(x, y) - 0.6, 6.0)
    return terrain


def _stands() -> list[Solid]:
    """Return the four sides in blocks with gangways 1.5 m wide, and three closed corners of four."""
    x0, y0, x1, y1 = COURT
    solids: list[Solid] = []
    sides = [
        ("north", y1, 0.5 * math.pi, x0, x1),
        ("south", y0, -0.5 * math.pi, x0, x1),
        ("west", x0, math.pi, y0, y1),
        ("east", x1, 0.0, y0, y1),
    ]
    gangway = 1.5
    for name, line, outward, begin, end in sides:
        rows, height = SIDES[name]
        blocks = round((end - begin) / 25.0)
        length = (end - begin - gangway * (blocks - 1)) / blocks
        for block in range(blocks):
            middle = begin + length / 2 + block * (length + gangway)
            front = (middle, line) if name in ("north", "south") else (line, middle)
            solids += scene_objects.stand(f"stand-{name}-{block}", front, outward, length, rows, height)
    for x, y, name in ((x0 - 4.5, y0 - 5.4, "sw"), (x0 - 4.5, y1 + 7.2, "nw"), (x1 + 4.5, y1 + 7.2, "ne")):
        depth = 10.8 if y < y0 else 14.4
        solids.append(Box(x, y, -0.5, 9.0, depth, 8.5, kind=Kind.CONCRETE, name=f"stadium-corner-{name}"))
    for x, y, name in ((-95.0, -12.0, "sw"), (25.0, 94.0, "ne"), (-105.0, 94.0, "nw"), (26.0, -8.0, "se")):
        solids.append(Cylinder(x, y, -0.5, 0.35, 28.5, Kind.METAL, f"floodlight-{name}"))
    return solids


def _street(rng: np.random.Generator) -> list[Solid]:
    """Return pavements behind kerbs, lamps, trees and parked cars along both sides of the street."""
    solids: list[Solid] = []
    for side, y in (("north", STREET[3] + PAVEMENT_M / 2), ("south", STREET[1] - PAVEMENT_M / 2)):
        name = f"pavement-{side}"
        solids.append(Box(0.0, y, -0.5, 400.0, PAVEMENT_M, 0.5 + KERB_M, kind=Kind.PAVING, name=name))
        towards_street = -0.5 * math.pi if side == "north" else 0.5 * math.pi
        kerb = y + (-1.0 if side == "north" else 1.0)
        for k, x in enumerate(np.arange(-190.0, 195.0, 28.0)):
            solids += scene_objects.lamp(f"lamp-{side}-{k}", float(x), kerb, KERB_M, 6.0, towards_street)
    for k, x in enumerate(np.arange(-182.0, 195.0, 14.0)):
        if rng.random() < 0.8:
            solids += scene_objects.tree(
                f"street-tree-{k}", float(x), -67.0, KERB_M, rng.uniform(5.0, 8.0), rng
            )
    lanes = {"north": STREET[3] - 1.15, "south": STREET[1] + 1.15}
    for side, y in lanes.items():
        for k, x in enumerate(np.arange(-190.0, 192.0, 6.5)):
            if rng.random() < 0.45:
                lean = float(rng.normal(0.0, 0.02))
                solids += scene_objects.parked_car(f"parked-{side}-{k}", float(x), y, 0.0, lean)
    return solids


def _plaza() -> list[Solid]:
    """Return the paved entrance with hedges on three sides and bollards towards the street."""
    x0, y0, x1, y1 = PLAZA
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    solids: list[Solid] = [
        Box(x, y, -0.5, x1 - x0, y1 - y0, 0.5 + KERB_M, kind=Kind.PAVING, name="plaza"),
        Box(x0 - 0.4, y, -0.5, 0.8, y1 - y0, 1.6, kind=Kind.FOLIAGE, name="hedge-west"),
        Box(x1 + 0.4, y, -0.5, 0.8, y1 - y0, 1.6, kind=Kind.FOLIAGE, name="hedge-east"),
        Box(x, y1 + 0.4, -0.5, x1 - x0, 0.8, 1.6, kind=Kind.FOLIAGE, name="hedge-north"),
    ]
    for k, px in enumerate(np.arange(x0 + 0.75, x1, 1.5)):
        solids.append(Cylinder(float(px), y0 + 0.2, 0.0, 0.08, 1.0, Kind.METAL, f"bollard-{k}"))
    for k, (px, py) in enumerate(
        ((x0 + 1, y0 + 20), (x0 + 1, y1 - 12), (x1 - 1, y0 + 20), (x1 - 1, y1 - 12))
    ):
        solids += scene_objects.lamp(f"plaza-lamp-{k}", px, py, KERB_M, 5.0, 0.0 if px < x else math.pi)
    return solids


def _roofs() -> list[Solid]:
    large_x, large_y = (LARGE_ROOF[0] + LARGE_ROOF[2]) / 2, (LARGE_ROOF[1] + LARGE_ROOF[3]) / 2
    small_x, small_y = (SMALL_ROOF[0] + SMALL_ROOF[2]) / 2, (SMALL_ROOF[1] + SMALL_ROOF[3]) / 2
    top = LARGE_ROOF_HEIGHT_M
    return [
        *scene_objects.flat_roof("large-roof", large_x, large_y, 0.0, (60.0, 40.0, top), 0.5),
        *scene_objects.flat_roof("small-roof", small_x, small_y, 0.0, (30.0, 28.0, SMALL_ROOF_HEIGHT_M), 0.4),
        Box(132.0, 57.0, top, 6.0, 4.0, 2.2, kind=Kind.METAL, name="roof-plant-chiller"),
        Box(141.0, 58.0, top, 3.0, 3.0, 1.4, kind=Kind.METAL, name="roof-plant-fan"),
        Box(150.0, 45.0, top, 3.0, 24.0, 0.9, kind=Kind.METAL, name="roof-plant-duct"),
        Box(172.0, 32.0, top, 4.0, 5.0, 2.6, kind=Kind.CONCRETE, name="roof-plant-stairhead"),
        Box(130.0, 38.0, top, 2.0, 2.0, 1.2, kind=Kind.METAL, name="roof-plant-vent"),
        Box(146.0, -24.0, SMALL_ROOF_HEIGHT_M, 1.5, 1.5, 1.1, kind=Kind.METAL, name="small-roof-vent"),
        Cylinder(168.0, 58.0, top, 0.04, 4.0, Kind.METAL, "roof-mast"),
    ]


def _park(terrain: Terrain, rng: np.random.Generator) -> list[Solid]:
    """Return trees and stones of the park, none of them in the open parts."""
    solids: list[Solid] = []
    for k in range(70):
        x, y = rng.uniform(-192.0, 192.0), rng.uniform(-192.0, -76.0)
        in_pond = ((x - POND[0]) / (POND[2] + 5)) ** 2 + ((y - POND[1]) / (POND[3] + 5)) ** 2 < 1.0
        if not in_pond and not (-80.0 < x < 60.0 and y > -112.0):
            solids += scene_objects.tree(
                f"park-tree-{k}", x, y, terrain.at(x, y), rng.uniform(5.0, 12.0), rng
            )
    for k in range(30):
        x, y = rng.uniform(60.0, 192.0), rng.uniform(112.0, 192.0)
        solids += scene_objects.tree(f"wood-tree-{k}", x, y, terrain.at(x, y), rng.uniform(7.0, 14.0), rng)
    for k in range(90):
        x, y = rng.uniform(RUBBLE[0], RUBBLE[2]), rng.uniform(RUBBLE[1], RUBBLE[3])
        solids += scene_objects.boulder(f"stone-{k}", x, y, terrain.at(x, y), rng.uniform(0.15, 0.6), rng)
    return solids


def _power_line(terrain: Terrain) -> list[Solid]:
    """Return two wires over the meadow on wooden poles, with the sag in straight pieces."""
    xs = (-185.0, -140.0, -95.0, -50.0)
    tops = [terrain.at(x, 150.0) + 8.5 for x in xs]
    solids: list[Solid] = [
        Cylinder(x, 150.0, top - 9.0, 0.12, 9.0, Kind.WOOD, f"pole-{k}")
        for k, (x, top) in enumerate(zip(xs, tops, strict=True))
    ]
    for span in range(len(xs) - 1):
        middle = ((xs[span] + xs[span + 1]) / 2, (tops[span] + tops[span + 1]) / 2 - 0.8)
        ends = ((xs[span], tops[span]), middle, (xs[span + 1], tops[span + 1]))
        for line, y in enumerate((149.6, 150.4)):
            for half in range(2):
                a, b = (ends[half][0], y, ends[half][1]), (ends[half + 1][0], y, ends[half + 1][1])
                solids.append(Wire(a, b, 0.008, Kind.METAL, f"cable-{span}-{line}-{half}"))
    return solids


def _regions() -> dict[str, Polygon]:
    x0, y0, x1, y1 = COURT
    depth = {name: rows * scene_objects.ROW_M for name, (rows, _) in SIDES.items()}
    return {
        "court": rectangle(*COURT),
        "stand_north": rectangle(x0, y1, x1, y1 + depth["north"]),
        "stand_south": rectangle(x0, y0 - depth["south"], x1, y0),
        "stand_west": rectangle(x0 - depth["west"], y0, x0, y1),
        "stand_east": rectangle(x1, y0, x1 + depth["east"], y1),
        "entrance": rectangle(*PLAZA),
        "street": rectangle(*STREET),
        "large_roof": rectangle(*LARGE_ROOF),
        "small_roof": rectangle(*SMALL_ROOF),
        "rubble": rectangle(*RUBBLE),
        "car_park": rectangle(*CAR_PARK),
        "meadow": rectangle(*MEADOW),
        "slope": rectangle(HILL[0] - 40, HILL[1] - 40, HILL[0] + 40, HILL[1] + 40),
        "pond": ellipse(*POND),
    }
