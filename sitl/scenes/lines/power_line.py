"""Meadows under overhead lines: a transmission line, a distribution line, a stayed mast and a wire fence."""

from __future__ import annotations

import math

import numpy as np

from sitl.scenes import scene_objects
from sitl.scenes.ground import LAWN_RELIEF_M, Terrain
from sitl.scenes.lines import overhead_lines
from sitl.scenes.lines.catenary import Point, span
from sitl.scenes.scene import Polygon, Scene, ellipse, rectangle
from sitl.world.primitives import Kind, Solid
from sitl.world.world import World

HALF_M = 240.0
MEADOW = (-24.0, -22.0, 24.0, 24.0)
"""Level meadow without any wire over it, about the start."""
TRANSMISSION_X_M = 62.0
DISTRIBUTION_Y_M = -40.0
MAST = (-75.0, 65.0)
HOUSE = (-70.0, -72.0)
PHASE_M, EARTH_M, LOW_VOLTAGE_M, TELEPHONE_M = 0.010, 0.005, 0.005, 0.0025
"""Radii of wires: 20 mm, 10 mm, 10 mm and 5 mm thick."""
ARM_M, UPPER_ARM_M = 5.0, 3.6


def build(seed: int) -> Scene:
    """Return the scene; the seed sets relief, heights, spans, kinds of pylons and the way of each line."""
    terrain_rng, rng = np.random.default_rng(seed).spawn(2)
    terrain = Terrain(HALF_M, 0.5, terrain_rng)
    terrain.swell(1.2, 90.0)
    terrain.hill(-120.0, 150.0, float(rng.uniform(6.0, 12.0)), 45.0)
    terrain.level(terrain.rectangle(*MEADOW), 0.0, 25.0)
    terrain.cover(terrain.rectangle(*MEADOW), Kind.GRASS, LAWN_RELIEF_M)
    solids: list[Solid] = []
    regions: dict[str, Polygon] = {"meadow": rectangle(*MEADOW)}
    regions["transmission_line"] = _transmission_line(terrain, solids, rng)
    regions["distribution_line"] = _distribution_line(terrain, solids, rng)
    regions["mast"] = _mast(terrain, solids, rng)
    regions["fence"] = _fence(terrain, solids, rng)
    for k in range(14):
        x, y = float(rng.uniform(-200.0, -110.0)), float(rng.uniform(-20.0, 200.0))
        solids += scene_objects.tree(f"tree-{k}", x, y, terrain.at(x, y), rng.uniform(5.0, 11.0), rng)
    return Scene(
        name="power_line",
        seed=seed,
        world=World(terrain.ground(), solids),
        home_enu=(0.0, 0.0, 0.0),
        description="Meadows under overhead lines, with a stayed mast and a wire fence",
        regions=regions,
    )


def _foot(terrain: Terrain, x: float, y: float) -> Point:
    return x, y, terrain.at(x, y)


def _transmission_line(terrain: Terrain, solids: list[Solid], rng: np.random.Generator) -> Polygon:
    """Add three pylons from south to north with three phases and an earth wire; return the way below."""
    long_m, short_m = float(rng.uniform(180.0, 300.0)), float(rng.uniform(70.0, 150.0))
    lattice = rng.random() < 0.5
    lean = float(rng.uniform(-0.05, 0.05))
    yaw = math.pi / 2 + lean
    south = -(long_m + short_m) / 2
    feet = [
        _foot(terrain, TRANSMISSION_X_M - math.tan(lean) * y, y)
        for y in (south, south + long_m, south + long_m + short_m)
    ]
    arm_m = float(rng.uniform(26.0, 42.0))
    points: list[list[Point]] = []
    for k, foot in enumerate(feet):
        name, over = f"pylon{k}", arm_m + float(rng.uniform(0.0, 3.0))
        top_m = over + 10.0
        solids += (
            overhead_lines.lattice_pylon(name, foot, top_m, yaw)
            if lattice
            else overhead_lines.tubular_pylon(name, foot, top_m)
        )
        own: list[Point] = []
        for number, (level, reach, sides) in enumerate(
            ((over, ARM_M, (-1, 1)), (over + 5.0, UPPER_ARM_M, (1,)))
        ):
            solids += overhead_lines.cross_arm(f"{name}-arm{number}", foot, level, reach, yaw, Kind.METAL)
            for side in sides:
                parts, point = overhead_lines.insulator(
                    f"{name}-insulator{number}{side:+d}", foot, level, side * (reach - 0.2), yaw
                )
                solids += parts
                own.append(point)
        points.append([*own, (foot[0], foot[1], foot[2] + top_m)])
    share = float(rng.uniform(0.022, 0.032))
    for k in range(2):
        length = math.dist(points[k][0][:2], points[k + 1][0][:2])
        for wire, (a, b) in enumerate(zip(points[k], points[k + 1], strict=True)):
            radius, tight = (EARTH_M, 0.8) if wire == 3 else (PHASE_M, 1.0)
            solids += span(f"line{k}-wire{wire}", a, b, tight * share * length, radius)
    (x0, y0, _), (x1, y1, _) = feet[0], feet[-1]
    reach = ARM_M
    return ((x0 - reach, y0), (x0 + reach, y0), (x1 + reach, y1), (x1 - reach, y1))


def _distribution_line(terrain: Terrain, solids: list[Solid], rng: np.random.Generator) -> Polygon:
    """Add wooden poles from west to east with three wires and a telephone wire, and a drop to a house."""
    y, x = DISTRIBUTION_Y_M - float(rng.uniform(0.0, 6.0)), 48.0
    tops: list[list[Point]] = []
    poles: list[Point] = []
    while x > -215.0:
        foot, height = _foot(terrain, x, y), float(rng.uniform(9.0, 11.5))
        parts, points = overhead_lines.wooden_pole(f"pole{len(poles)}", foot, height, 0.0)
        solids += parts
        poles.append(foot)
        tops.append([*points, (foot[0], foot[1], foot[2] + height - 3.0)])
        x -= float(rng.uniform(30.0, 60.0))
    for k in range(len(poles) - 1):
        length = poles[k][0] - poles[k + 1][0]
        for wire, (a, b) in enumerate(zip(tops[k], tops[k + 1], strict=True)):
            radius = TELEPHONE_M if wire == 3 else LOW_VOLTAGE_M
            solids += span(f"low{k}-wire{wire}", a, b, 0.018 * length, radius)
    end = poles[0]
    anchor = (end[0] + 7.0, end[1], terrain.at(end[0] + 7.0, end[1]))
    solids += span("pole0-stay", anchor, (end[0], end[1], tops[0][0][2]), 0.03, LOW_VOLTAGE_M)
    _house(terrain, solids, tops, rng)
    west, east = poles[-1][0], poles[0][0]
    return rectangle(west, y - 1.2, east, y + 1.2)


def _house(terrain: Terrain, solids: list[Solid], tops: list[list[Point]], rng: np.random.Generator) -> None:
    """Add a house and its service drop from the nearest pole."""
    x, y = HOUSE
    z, height = terrain.at(x, y), float(rng.uniform(4.5, 6.5))
    solids += scene_objects.flat_roof("house", x, y, z, (11.0, 9.0, height), 0.3)
    pole = min(tops, key=lambda points: abs(points[0][0] - x))
    for k in range(2):
        eave = (x + 0.5 * k, y + 4.5, z + height - 0.4)
        solids += span(f"drop{k}", pole[3], eave, 0.5, LOW_VOLTAGE_M if k == 0 else TELEPHONE_M)


def _mast(terrain: Terrain, solids: list[Solid], rng: np.random.Generator) -> Polygon:
    """Add a mast with stays at three bearings."""
    height, turn = float(rng.uniform(22.0, 40.0)), float(rng.uniform(0.0, 2 * math.pi))
    reach = 0.65 * height
    anchors = [
        _foot(terrain, MAST[0] + reach * math.cos(turn + a), MAST[1] + reach * math.sin(turn + a))
        for a in (0.0, 2 * math.pi / 3, 4 * math.pi / 3)
    ]
    solids += overhead_lines.stayed_mast("mast", _foot(terrain, *MAST), height, anchors, LOW_VOLTAGE_M)
    return ellipse(*MAST, reach, reach)


def _fence(terrain: Terrain, solids: list[Solid], rng: np.random.Generator) -> Polygon:
    """Add a pasture fence north of the meadow."""
    y, apart = 34.0 + float(rng.uniform(0.0, 8.0)), float(rng.uniform(3.0, 5.0))
    posts = [_foot(terrain, float(x), y) for x in np.arange(-45.0, 45.0, apart)]
    solids += overhead_lines.wire_fence("fence", posts)
    return rectangle(posts[0][0], y - 0.2, posts[-1][0], y + 0.2)
