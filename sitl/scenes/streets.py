"""Road with houses and small yards on both sides (scene 2)."""

from __future__ import annotations

import math

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import LAWN_RELIEF_M, Terrain
from sitl.scenes.scene import Polygon, Scene, rectangle
from sitl.world.primitives import Box, Kind, Solid, Wire
from sitl.world.world import World

ROAD = (-150.0, -4.0, 150.0, 4.0)
GREEN = (20.0, 48.0, 60.0, 80.0)
GARDEN = (22.0, 50.0, 58.0, 78.0)
HOME = (40.0, 64.0)
BED_M = 2.0
"""Distance of the kerbs and flagstones of the garden; one place in four is empty."""
KERB_M, HOME_KERB_M, EDGING_M = (0.1, 0.195), (0.15, 0.195), ((18.5, 0.22), (61.5, 0.24))
"""Heights of kerbs and of those near home; east and height of edgings. Higher ones are no safe relief."""
HOME_FREE_M, HOME_NEAR_M = 0.6, 8.5
PLOT_M, YARD_Y = 22.0, (26.0, 44.0)


def build(seed: int) -> Scene:
    """Return the street scene; the seed moves houses, trees and cars within their plots, and kerbs."""
    terrain_rng, rng, garden_rng = np.random.default_rng(seed).spawn(3)
    terrain = Terrain(150.0, 0.5, terrain_rng)
    terrain.swell(0.6, 90.0)
    terrain.level(terrain.rectangle(-150.0, -60.0, 150.0, 90.0), 0.0, 30.0)
    terrain.cover(terrain.rectangle(*ROAD), Kind.ASPHALT)
    terrain.cover(terrain.rectangle(*GREEN), Kind.GRASS, LAWN_RELIEF_M)
    solids = [*_road(rng), *_garden(garden_rng)]
    regions: dict[str, Polygon] = {
        "road": rectangle(*ROAD),
        "green": rectangle(*GREEN),
        "garden": rectangle(*GARDEN),
    }
    for side in (1.0, -1.0):
        for k, x in enumerate(np.arange(-132.0, 133.0, PLOT_M)):
            plot = f"plot-{'north' if side > 0 else 'south'}-{k}"
            solids += _plot(plot, float(x), side, rng)
            ys = sorted((side * YARD_Y[0], side * YARD_Y[1]))
            regions[plot] = rectangle(float(x) - 10.0, ys[0], float(x) + 10.0, ys[1])
    return Scene(
        name="streets",
        seed=seed,
        world=World(terrain.ground(), solids),
        home_enu=(*HOME, 0.0),
        description="A road with kerbs, cars and overhead wires, houses, fenced yards and a village green "
        "with a garden of kerbs and flagstones",
        regions=regions,
    )


def _road(rng: np.random.Generator) -> list[Solid]:
    solids: list[Solid] = []
    for side in (1.0, -1.0):
        name = "north" if side > 0 else "south"
        solids.append(Box(0.0, side * 5.5, -0.5, 300.0, 3.0, 0.65, kind=Kind.PAVING, name=f"pavement-{name}"))
        for k, x in enumerate(np.arange(-143.0, 143.0, 6.5)):
            if rng.random() < 0.3:
                solids += scene_objects.parked_car(f"parked-{name}-{k}", float(x), side * 2.9, 0.0, 0.0)
    xs = np.arange(-140.0, 141.0, 35.0)
    for k, x in enumerate(xs):
        solids += scene_objects.lamp(f"lamp-{k}", float(x), 6.6, 0.15, 7.0, -0.5 * math.pi)
    for k in range(len(xs) - 1):
        a, b = (float(xs[k]), 6.6, 6.9), (float(xs[k + 1]), 6.6, 6.9)
        solids.append(Wire(a, b, 0.008, Kind.METAL, f"cable-{k}"))
    return solids


def _garden(rng: np.random.Generator) -> list[Solid]:
    """Return kerbs and flagstones of 0.1 m to 0.24 m: safe by slope and relief, but no level stand."""
    foot_m = scene_objects.FOOT_M
    solids: list[Solid] = [
        Box(x, HOME[1], -foot_m, 0.12, 28.0, foot_m + height, 0.0, Kind.CONCRETE, f"kerb-edging-{height:.2f}")
        for x, height in EDGING_M
    ]
    x0, y0, x1, y1 = GARDEN
    for x in np.arange(x0 + BED_M / 2, x1, BED_M):
        for y in np.arange(y0 + BED_M / 2, y1, BED_M):
            px, py = float(x + rng.uniform(-0.3, 0.3)), float(y + rng.uniform(-0.3, 0.3))
            away_m = math.dist((px, py), HOME)
            height = float(rng.uniform(*(HOME_KERB_M if away_m < HOME_NEAR_M else KERB_M)))
            yaw = float(rng.uniform(0.0, math.pi))
            kerb = rng.random() < 0.7
            length, width = rng.uniform((0.9, 0.1), (1.5, 0.15)) if kerb else [rng.uniform(0.4, 0.6)] * 2
            if rng.random() < 0.25 or away_m < HOME_FREE_M + length / 2:
                continue
            name = f"{'kerb' if kerb else 'flagstone'}-{len(solids)}-{height:.2f}"
            size = float(length), float(width), foot_m + height
            solids.append(Box(px, py, -foot_m, *size, yaw, Kind.CONCRETE, name))
    return solids


def _plot(name: str, x: float, side: float, rng: np.random.Generator) -> list[Solid]:
    """Return a house, a fenced yard behind it, a shed and a tree."""
    length, width, height = rng.uniform(9.0, 13.0), rng.uniform(8.0, 10.0), rng.uniform(4.0, 8.0)
    solids = scene_objects.flat_roof(f"{name}-house", x, side * 16.0, 0.0, (length, width, height), 0.25)
    # A block on the roof represents the ridge, so that no roof here is landable.
    solids.append(Box(x, side * 16.0, height, length - 2, 2.0, 1.6, kind=Kind.ROOF, name=f"{name}-ridge"))
    near, far = side * (YARD_Y[0] - 4.0), side * (YARD_Y[1] + 1.0)
    for edge in (-PLOT_M / 2, PLOT_M / 2):
        solids += scene_objects.fence(f"{name}-fence{edge:+.0f}", (x + edge, near), (x + edge, far), 0.0)
    if rng.random() < 0.7:
        shed_x, shed_y = x + rng.uniform(-7.0, 7.0), side * rng.uniform(40.0, 43.0)
        solids.append(Box(shed_x, shed_y, -0.5, 3.0, 2.5, 2.9, kind=Kind.WOOD, name=f"{name}-shed"))
    tree_x, tree_y = x + rng.uniform(-8.0, 8.0), side * rng.uniform(24.0, 38.0)
    solids += scene_objects.tree(f"{name}-tree", tree_x, tree_y, 0.0, rng.uniform(4.0, 8.0), rng)
    return solids
