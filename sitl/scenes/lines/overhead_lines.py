"""Objects of overhead lines: pylons, poles, masts with stays, wire fences."""

from __future__ import annotations

import itertools
import math

from sitl.scenes.lines.catenary import Point, span
from sitl.scenes.scene_objects import FOOT_M
from sitl.world.primitives import Box, Cylinder, Kind, Solid, Wire

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
