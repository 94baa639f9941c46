"""Scenes of hills: a steep hill, a mountain valley and a borrow pit."""

from __future__ import annotations

import math

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import Terrain
from sitl.scenes.scene import Scene, ellipse, rectangle
from sitl.world.primitives import Box, Ellipsoid, Kind, Solid
from sitl.world.world import World

RADIUS_M = 70.0


def build_hill(seed: int) -> Scene:
    """Return the hill scene; the top is a ridge of rock, too rough and too steep to land on."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(200.0, 0.5, terrain_rng)
    terrain.swell(0.35, 80.0)
    distance = np.hypot(terrain.x, terrain.y)
    terrain.z += 0.42 * np.maximum(RADIUS_M - distance, 0.0)
    terrain.cover(distance < 30.0, Kind.ROCK, 0.10)
    terrain.level(terrain.rectangle(-12.0, -132.0, 12.0, -108.0), 0.0, 12.0)
    solids: list[Solid] = []
    for k in range(45):
        turn, reach = rng.uniform(0.0, 2 * math.pi), rng.uniform(20.0, 78.0)
        x, y = reach * math.cos(turn), reach * math.sin(turn)
        solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(4.0, 9.0), rng)
    for k in range(50):
        x, y = rng.normal(0.0, 9.0, 2).clip(-25.0, 25.0)
        solids += scene_objects.boulder(f"stone-{k}", x, y, terrain.at(x, y), rng.uniform(0.3, 0.9), rng)
    return Scene(
        name="hill",
        seed=seed,
        world=World(terrain.ground(), solids),
        home_enu=(0.0, -120.0, 0.0),
        description="A wooded hill of 23 deg with a rocky top, meadows all around",
        regions={
            "hill": ellipse(0.0, 0.0, RADIUS_M, RADIUS_M),
            "meadow_south": rectangle(-190.0, -190.0, 190.0, -85.0),
            "meadow_north": rectangle(-190.0, 85.0, 190.0, 190.0),
        },
    )


HALF_M = 400.0
VALLEY = (-380.0, -45.0, 380.0, 45.0)


def build_mountains(seed: int) -> Scene:
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


BOXES = ((-4.0, 0.0, 1.0), (4.0, 0.0, 2.0))
"""East, north and height of the two boxes; each is 3 m square."""
BOX_SIDE_M = 3.0
PLOT_M = 24.0
"""Half side of the floor with hazards."""
SPACING_M = 4.0


def build_borrow_pit(seed: int) -> Scene:
    """Return the pit: a floor of 60 m, rim 4 m high, hazards of 0.3 m to 2.5 m on a jittered lattice."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(60.0, 0.2, terrain_rng)
    terrain.cover(terrain.rectangle(-60, -60, 60, 60), Kind.SOIL)
    away = np.maximum(np.abs(terrain.x), np.abs(terrain.y))
    terrain.swell(0.05, 40.0)
    terrain.z += 4.0 / (1.0 + np.exp(-(away - 40.0) / 1.5))
    solids: list[Solid] = [
        Box(x, y, terrain.at(x, y) - 0.3, BOX_SIDE_M, BOX_SIDE_M, h + 0.3, 0.0, Kind.WOOD, f"box-{h:g}m")
        for x, y, h in BOXES
    ]
    _scatter(terrain, solids, rng)
    return Scene(
        name="borrow_pit",
        seed=seed,
        world=World(terrain.ground(), solids),
        home_enu=(0.0, -30.0, 0.0),
        description="Pit with rocks, hemispheres and craters of 0.3 m and more, and boxes of 1 m and 2 m",
        regions={
            "boxes": rectangle(-7.0, -3.0, 7.0, 3.0),
            "floor": rectangle(-PLOT_M, -PLOT_M, PLOT_M, PLOT_M),
        },
    )


def _scatter(terrain: Terrain, solids: list[Solid], rng: np.random.Generator) -> None:
    """Place rocks, hemispheres and craters on a jittered lattice, clear of the boxes and of each other."""
    for k, (x, y) in enumerate(_places(rng)):
        kind = rng.random()
        size = float(0.3 * (2.5 / 0.3) ** (rng.random() ** 1.6))
        if kind < 0.2:
            depth = min(size, 1.0)
            _crater(terrain, x, y, depth)
        elif kind < 0.4:
            r = min(size, 1.2)
            solids.append(Ellipsoid(x, y, terrain.at(x, y), r, r, r, Kind.CONCRETE, f"dome-{k}-{r:.2f}"))
        else:
            h = min(size, 1.5)
            a, b = h * rng.uniform(0.8, 1.4, 2)
            solids.append(Ellipsoid(x, y, terrain.at(x, y), a, b, h, Kind.ROCK, f"rock-{k}-{h:.2f}"))


def _places(rng: np.random.Generator) -> list[tuple[float, float]]:
    axis = np.arange(-PLOT_M + 2.0, PLOT_M, SPACING_M)
    places = []
    for y in axis:
        for x in axis:
            px, py = x + rng.uniform(-0.5, 0.5), y + rng.uniform(-0.5, 0.5)
            if rng.random() < 0.6 and not (abs(py) < 5.0 and abs(px) < 9.0):
                places.append((float(px), float(py)))
    return places


def _crater(terrain: Terrain, x: float, y: float, depth_m: float) -> None:
    """Dig a bowl three times as wide as deep, without a wall around its rim."""
    radius = 1.5 * depth_m
    way = np.hypot(terrain.x - x, terrain.y - y) / radius
    inside = way < 1.0
    terrain.z[inside] -= depth_m * 0.5 * (1 + np.cos(math.pi * way[inside]))
