"""Power lines: catenaries, pylons and poles, and a scene beside a transmission line."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from sitl.scenes import scene_objects
from sitl.scenes.ground import LAWN_RELIEF_M, Terrain
from sitl.scenes.scene import Polygon, Scene, ellipse, rectangle
from sitl.scenes.scene_objects import FOOT_M
from sitl.world.primitives import Box, Cylinder, Kind, Solid, Wire
from sitl.world.world import World

F64 = NDArray[np.float64]
Point = tuple[float, float, float]

ERROR_M = 0.8e-3
"""Greatest height of the catenary below the chord of a piece."""


def constant_m(length_m: float, rise_m: float, sag_m: float) -> float:
    """Return the catenary constant (horizontal tension per weight) of a span.

    Parameters
    ----------
    length_m, rise_m
        Horizontal distance and difference of the heights of the ends.
    sag_m
        Height of the chord over the wire at mid-span.
    """
    low, high = 1e-2 * length_m, 1e7 * length_m
    for _ in range(200):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if _sag_m(middle, length_m, rise_m) > sag_m else (low, middle)
    return math.sqrt(low * high)


def heights_m(along_m: F64, length_m: float, rise_m: float, sag_m: float) -> F64:
    """Return the heights of a span over its start at horizontal distances from it."""
    a = constant_m(length_m, rise_m, sag_m)
    lowest = length_m / 2 - a * math.asinh(rise_m / (2 * a * math.sinh(length_m / (2 * a))))
    heights: F64 = a * (np.cosh((along_m - lowest) / a) - math.cosh(lowest / a))
    return heights


def span(
    name: str, start: Point, end: Point, sag_m: float, radius_m: float, kind: Kind = Kind.METAL
) -> list[Wire]:
    """Return a span whose pieces depart from the catenary by less than 1 mm; no sag is one straight piece."""
    length, rise = math.dist(start[:2], end[:2]), end[2] - start[2]
    count = 1
    if sag_m > 0.0:
        a = constant_m(length, rise, sag_m)
        steepest = abs(math.asinh(rise / (2 * a * math.sinh(length / (2 * a))))) + length / (2 * a)
        count = math.ceil(length / math.sqrt(8.0 * a * ERROR_M / math.cosh(steepest)))
    share = np.linspace(0.0, 1.0, count + 1)
    x, y = (start[k] + share * (end[k] - start[k]) for k in (0, 1))
    z = start[2] + (heights_m(share * length, length, rise, sag_m) if sag_m > 0.0 else share * rise)
    nodes = [tuple(map(float, node)) for node in zip(x, y, z, strict=True)]
    return [
        Wire((a[0], a[1], a[2]), (b[0], b[1], b[2]), radius_m, kind, f"{name}-{k}")
        for k, (a, b) in enumerate(itertools.pairwise(nodes))
    ]


def _sag_m(a: float, length_m: float, rise_m: float) -> float:
    half = length_m / (2 * a)
    if half > 300.0:  # beyond the range of cosh
        return math.inf
    slope = rise_m / (2 * a * math.sinh(half))
    # cosh(half) - 1 without the loss of digits where the wire is tight.
    return 2 * a * math.sqrt(1.0 + slope * slope) * math.sinh(half / 2) ** 2


INSULATOR_M = 1.6
LEG_M, BRACE_M = 0.08, 0.04  # radii of a lattice's members
PANEL_M = 8.0


def lattice_pylon(name: str, foot: Point, height_m: float, yaw: float) -> list[Solid]:
    """Return a square lattice tower on legs that lean inwards, braced in panels of about `PANEL_M`."""
    panels = max(2, round(height_m / PANEL_M))
    levels = [foot[2] - FOOT_M, *(foot[2] + height_m * (k + 1) / panels for k in range(panels))]
    half = [0.6 + 2.4 * (1.0 - max(0.0, z - foot[2]) / height_m) for z in levels]
    corners = [
        [_aside(foot, yaw, sx * h, sy * h, z) for sx, sy in _SQUARE]
        for z, h in zip(levels, half, strict=True)
    ]
    parts: list[Solid] = []
    for k in range(4):
        parts.append(Wire(corners[0][k], corners[-1][k], LEG_M, Kind.METAL, f"{name}-leg{k}"))
        for level in range(panels):
            brace = corners[level][k], corners[level + 1][(k + 1) % 4]
            parts.append(Wire(*brace, BRACE_M, Kind.METAL, f"{name}-brace{level}-{k}"))
            ring = corners[level + 1][k], corners[level + 1][(k + 1) % 4]
            parts.append(Wire(*ring, BRACE_M, Kind.METAL, f"{name}-ring{level}-{k}"))
    return parts


_SQUARE = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def tubular_pylon(name: str, foot: Point, height_m: float) -> list[Solid]:
    """Return a steel pole in three lengths, each thinner than the one below."""
    x, y, z = foot
    third = height_m / 3
    return [
        Cylinder(
            x,
            y,
            z + k * third - (FOOT_M if k == 0 else 0.0),
            0.7 - 0.2 * k,
            third + (FOOT_M if k == 0 else 0.0),
            Kind.METAL,
            f"{name}-length{k}",
        )
        for k in range(3)
    ]


def cross_arm(name: str, foot: Point, over_m: float, half_m: float, yaw: float, kind: Kind) -> list[Solid]:
    """Return a beam across the line, `over_m` over the foot; yaw is the direction of the line."""
    turned = yaw + math.pi / 2
    return [Box(foot[0], foot[1], foot[2] + over_m, 2 * half_m, 0.2, 0.25, turned, kind, name)]


def insulator(name: str, foot: Point, over_m: float, aside_m: float, yaw: float) -> tuple[list[Solid], Point]:
    """Return an insulator that hangs from an arm `over_m` over the foot, and its lower end."""
    x, y, z = _aside(foot, yaw, 0.0, aside_m, foot[2] + over_m - INSULATOR_M)
    return [Cylinder(x, y, z, 0.08, INSULATOR_M, Kind.CONCRETE, name)], (x, y, z)


def wooden_pole(name: str, foot: Point, height_m: float, yaw: float) -> tuple[list[Solid], list[Point]]:
    """Return a pole with an arm across the line and the points of its three wires."""
    x, y, z = foot
    parts: list[Solid] = [
        Cylinder(x, y, z - FOOT_M, 0.14, height_m + FOOT_M, Kind.WOOD, f"{name}-pole"),
        Box(x, y, z + height_m - 0.5, 2.4, 0.1, 0.12, yaw + math.pi / 2, Kind.WOOD, f"{name}-arm"),
    ]
    points = [_aside(foot, yaw, 0.0, aside, z + height_m - 0.3) for aside in (-1.1, 1.1)]
    return parts, [*points, (x, y, z + height_m + 0.1)]


def stayed_mast(
    name: str, foot: Point, height_m: float, anchors: list[Point], radius_m: float
) -> list[Solid]:
    """Return a slender mast with stays from its top and from 0.6 of its height to each anchor."""
    x, y, z = foot
    parts: list[Solid] = [Cylinder(x, y, z - FOOT_M, 0.15, height_m + FOOT_M, Kind.METAL, f"{name}-tube")]
    for k, anchor in enumerate(anchors):
        for level, share in (("top", 0.98), ("middle", 0.6)):
            top = (x, y, z + share * height_m)
            parts += span(f"{name}-stay{k}-{level}", anchor, top, 0.004 * height_m, radius_m)
    return parts


def wire_fence(
    name: str, posts: list[Point], radius_m: float = 0.00125, levels_m: tuple[float, ...] = (0.4, 0.75, 1.1)
) -> list[Solid]:
    """Return a pasture fence: wooden posts and strands of wire between them."""
    parts: list[Solid] = [
        Cylinder(x, y, z - FOOT_M, 0.05, 1.2 + FOOT_M, Kind.WOOD, f"{name}-post{k}")
        for k, (x, y, z) in enumerate(posts)
    ]
    for k, (a, b) in enumerate(itertools.pairwise(posts)):
        for strand, over in enumerate(levels_m):
            ends = (a[0], a[1], a[2] + over), (b[0], b[1], b[2] + over)
            parts.append(Wire(*ends, radius_m, Kind.METAL, f"{name}-strand{k}-{strand}"))
    return parts


def _aside(foot: Point, yaw: float, along_m: float, aside_m: float, z: float) -> Point:
    c, s = math.cos(yaw), math.sin(yaw)
    return foot[0] + c * along_m - s * aside_m, foot[1] + s * along_m + c * aside_m, z


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


def build_power_line(seed: int) -> Scene:
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
        solids += lattice_pylon(name, foot, top_m, yaw) if lattice else tubular_pylon(name, foot, top_m)
        own: list[Point] = []
        for number, (level, reach, sides) in enumerate(
            ((over, ARM_M, (-1, 1)), (over + 5.0, UPPER_ARM_M, (1,)))
        ):
            solids += cross_arm(f"{name}-arm{number}", foot, level, reach, yaw, Kind.METAL)
            for side in sides:
                parts, point = insulator(
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
        parts, points = wooden_pole(f"pole{len(poles)}", foot, height, 0.0)
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
    solids += stayed_mast("mast", _foot(terrain, *MAST), height, anchors, LOW_VOLTAGE_M)
    return ellipse(*MAST, reach, reach)


def _fence(terrain: Terrain, solids: list[Solid], rng: np.random.Generator) -> Polygon:
    """Add a pasture fence north of the meadow."""
    y, apart = 34.0 + float(rng.uniform(0.0, 8.0)), float(rng.uniform(3.0, 5.0))
    posts = [_foot(terrain, float(x), y) for x in np.arange(-45.0, 45.0, apart)]
    solids += wire_fence("fence", posts)
    return rectangle(posts[0][0], y - 0.2, posts[-1][0], y + 0.2)
