"""Objects of scenes: trees, lamps, cars, fences, stands, buildings."""

from __future__ import annotations

import math

import numpy as np

from sitl.world.primitives import Box, Cylinder, Ellipsoid, Kind, Solid, Wire
from sitl.world.world import CAR, Mover

FOOT_M = 0.5
"""Depth of objects in the ground, so that none floats above a dip."""
ROW_M = 0.9
"""Depth of a row of a stand."""


def tree(name: str, x: float, y: float, z: float, height_m: float, rng: np.random.Generator) -> list[Solid]:
    """Return a trunk and a crown of three ellipsoids."""
    radius = height_m * rng.uniform(0.24, 0.32)
    crown_z = z + height_m - 1.1 * radius
    trunk_height = crown_z - z + FOOT_M
    parts: list[Solid] = [
        Cylinder(x, y, z - FOOT_M, 0.02 * height_m + 0.05, trunk_height, Kind.WOOD, f"{name}-trunk"),
        Ellipsoid(x, y, crown_z, radius, radius, 1.1 * radius, Kind.FOLIAGE, f"{name}-crown"),
    ]
    for side in range(2):
        angle, reach = rng.uniform(0.0, 2 * math.pi), 0.45 * radius
        cx, cy, size = x + reach * math.cos(angle), y + reach * math.sin(angle), 0.7 * radius
        low = crown_z - 0.4 * radius
        parts.append(Ellipsoid(cx, cy, low, size, size, size, Kind.FOLIAGE, f"{name}-bough{side}"))
    return parts


def lamp(name: str, x: float, y: float, z: float, height_m: float = 6.0, arm_yaw: float = 0.0) -> list[Solid]:
    """Return a lamp post with an arm 1.2 m long."""
    top = z + height_m - 0.1
    end = (x + 1.2 * math.cos(arm_yaw), y + 1.2 * math.sin(arm_yaw), top)
    return [
        Cylinder(x, y, z - FOOT_M, 0.06, height_m + FOOT_M, Kind.METAL, f"{name}-post"),
        Wire((x, y, top), end, 0.04, Kind.METAL, f"{name}-arm"),
    ]


def parked_car(name: str, x: float, y: float, z: float, yaw: float) -> list[Solid]:
    """Return a stationary car."""
    return list(Mover(name, CAR, x, y, z, yaw).placed())


def boulder(name: str, x: float, y: float, z: float, size_m: float, rng: np.random.Generator) -> list[Solid]:
    """Return a stone half sunk into the ground; ``size_m`` is about its height above it."""
    a, b = size_m * rng.uniform(0.8, 1.6, 2)
    return [Ellipsoid(x, y, z, a, b, size_m, Kind.ROCK, name)]


def fence(name: str, start: tuple[float, float], end: tuple[float, float], z: float) -> list[Solid]:
    """Return posts every 2.5 m and two rails, 1.2 m high."""
    length = math.dist(start, end)
    count = max(int(length / 2.5), 1)
    parts: list[Solid] = []
    for k in range(count + 1):
        x = start[0] + (end[0] - start[0]) * k / count
        y = start[1] + (end[1] - start[1]) * k / count
        parts.append(Cylinder(x, y, z - FOOT_M, 0.05, 1.2 + FOOT_M, Kind.WOOD, f"{name}-post{k}"))
    for rail, height in enumerate((0.6, 1.1)):
        ends = ((*start, z + height), (*end, z + height))
        parts.append(Wire(*ends, 0.03, Kind.WOOD, f"{name}-rail{rail}"))
    return parts


def flat_roof(
    name: str,
    x: float,
    y: float,
    z: float,
    size_m: tuple[float, float, float],
    parapet_m: float,
    kind: Kind = Kind.ROOF,
) -> list[Solid]:
    """Return a building with a flat roof (length, width, height) and a parapet 0.3 m thick around it.

    A parapet of 0 is none.
    """
    length, width, height = size_m
    top, thick = z + height, 0.3
    body = Box(x, y, z - FOOT_M, length, width, height + FOOT_M, kind=kind, name=f"{name}-body")
    if parapet_m == 0.0:
        return [body]
    along, across = (length, thick), (thick, width)
    edges = [
        (x, y - width / 2 + thick / 2, along, "south"),
        (x, y + width / 2 - thick / 2, along, "north"),
        (x - length / 2 + thick / 2, y, across, "west"),
        (x + length / 2 - thick / 2, y, across, "east"),
    ]
    walls = [
        Box(ex, ey, top, *size, parapet_m, kind=Kind.CONCRETE, name=f"{name}-parapet-{side}")
        for ex, ey, size, side in edges
    ]
    return [body, *walls]


def stand(
    name: str,
    front: tuple[float, float],
    outward_yaw: float,
    length_m: float,
    rows: int,
    height_m: float,
) -> list[Solid]:
    """Return a stepped stand: rows rising from a front wall of 1.2 m to height_m.

    ``front`` is the middle of its front edge on the ground at z = 0; the rows rise along outward_yaw.
    """
    depth, first = ROW_M, 1.2
    c, s = math.cos(outward_yaw), math.sin(outward_yaw)
    parts: list[Solid] = []
    for row in range(rows):
        top = first + (height_m - first) * row / max(rows - 1, 1)
        away = (row + 0.5) * depth
        parts.append(
            Box(
                front[0] + c * away,
                front[1] + s * away,
                -FOOT_M,
                depth,
                length_m,
                top + FOOT_M,
                outward_yaw,
                Kind.CONCRETE,
                f"{name}-row{row}",
            )
        )
    return parts


def goal(name: str, x: float, y: float, z: float, into_court: float) -> list[Solid]:
    """Return a football goal on the line x, 7.32 x 2.44 m, opening towards ``into_court`` (+1 or -1)."""
    half, height, back = 3.66, 2.44, x - into_court * 2.0
    parts: list[Solid] = []
    for side, py in (("a", y - half), ("b", y + half)):
        parts.append(Cylinder(x, py, z - FOOT_M, 0.06, height + FOOT_M, Kind.METAL, f"{name}-post-{side}"))
        net = ((x, py, z + height), (back, py, z + 0.03))
        parts.append(Wire(*net, 0.03, Kind.METAL, f"{name}-stay-{side}"))
    bar = ((x, y - half, z + height), (x, y + half, z + height))
    parts.append(Wire(*bar, 0.06, Kind.METAL, f"{name}-bar"))
    return parts


def grove(
    name: str, area: tuple[float, float, float, float], spacing_m: float, rng: np.random.Generator
) -> list[Solid]:
    """Return trees on a lattice on level ground at z = 0: no square of ``spacing_m`` + 4 m stays free."""
    x0, y0, x1, y1 = area
    solids: list[Solid] = []
    for j, y in enumerate(np.arange(y0 + 3.0, y1, spacing_m)):
        for i, x in enumerate(np.arange(x0 + 3.0, x1, spacing_m)):
            dx, dy = rng.uniform(-1.5, 1.5, 2)
            solids += tree(f"{name}-{j}-{i}", float(x) + dx, float(y) + dy, 0.0, rng.uniform(4.5, 8.0), rng)
    return solids


def car_park(
    name: str, area: tuple[float, float, float, float], row_m: float, rng: np.random.Generator
) -> list[Solid]:
    """Return rows of cars, parked across the row at z = 0, one bay in four empty."""
    x0, y0, x1, y1 = area
    solids: list[Solid] = []
    for j, y in enumerate(np.arange(y0 + 3.0, y1 - 2.0, row_m)):
        for i, x in enumerate(np.arange(x0 + 2.0, x1 - 1.0, 2.8)):
            if rng.random() < 0.75:
                lean = float(0.5 * math.pi + rng.normal(0.0, 0.03))
                solids += parked_car(f"{name}-{j}-{i}", float(x), float(y), 0.0, lean)
    return solids
