"""Triangle meshes of a simulated world, built from the definitions of its primitives alone.

A bilinear square lies between its two triangulations, since it lies within the tetrahedron of its four
corners: that of the higher diagonal is nowhere below it, that of the lower one nowhere above. Round solids
are inscribed polyhedra; `inscribed_gap_m` bounds how far inside their surface these are.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sitl.world.primitives import Box, Cylinder, Ellipsoid, Ground, Solid, Wire

F64 = NDArray[np.float64]
AROUND, UP = 64, 32
"""Segments of a full turn, and from pole to pole."""
_FACES = ((0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7))


def ground_triangles(ground: Ground, diagonal: str) -> F64:
    """Return the ground as two triangles a square, (n, 3, 3).

    Parameters
    ----------
    ground
        Bilinear height field.
    diagonal
        "higher" or "lower": the surface is nowhere above the first, nowhere below the second.
    """
    z = ground.z_m
    x = ground.x0_m + ground.post_m * np.arange(z.shape[1])
    y = ground.y0_m + ground.post_m * np.arange(z.shape[0])
    posts = np.stack([*np.meshgrid(x, y), z], axis=-1)
    p00, p10, p01, p11 = (
        corner.reshape(-1, 3) for corner in (posts[:-1, :-1], posts[:-1, 1:], posts[1:, :-1], posts[1:, 1:])
    )
    rising = p00[:, 2] + p11[:, 2] > p10[:, 2] + p01[:, 2]
    if diagonal == "lower":
        rising = ~rising
    cut = rising[:, np.newaxis, np.newaxis]
    first = np.where(cut, np.stack([p00, p10, p11], 1), np.stack([p00, p10, p01], 1))
    second = np.where(cut, np.stack([p00, p11, p01], 1), np.stack([p10, p11, p01], 1))
    return np.concatenate([first, second])


def heights(ground: Ground, x: F64, y: F64) -> F64:
    """Return the bilinear height at places (n,), each within the ground."""
    u, v = (x - ground.x0_m) / ground.post_m, (y - ground.y0_m) / ground.post_m
    i = np.clip(np.floor(u).astype(int), 0, ground.z_m.shape[1] - 2)
    j = np.clip(np.floor(v).astype(int), 0, ground.z_m.shape[0] - 2)
    u, v, z = u - i, v - j, ground.z_m
    low = z[j, i] * (1 - u) + z[j, i + 1] * u
    high = z[j + 1, i] * (1 - u) + z[j + 1, i + 1] * u
    height: F64 = low * (1 - v) + high * v
    return height


def solid_triangles(solid: Solid) -> F64:
    """Return the triangles (n, 3, 3) of a solid."""
    if isinstance(solid, Box):
        return _box(solid)
    if isinstance(solid, Cylinder):
        ring = _ring(AROUND) * solid.radius_m + (solid.x_m, solid.y_m)
        return _tube(ring, solid.z_m, solid.z_m + solid.height_m)
    if isinstance(solid, Ellipsoid):
        return _ellipsoid(solid)
    return _wire(solid)


def inscribed_gap_m(solid: Solid) -> float:
    """Return how far a solid's triangles are from its surface at most."""
    around, up = 1.0 - math.cos(math.pi / AROUND), 1.0 - math.cos(math.pi / (2 * UP))
    if isinstance(solid, Box):
        return 0.0
    if isinstance(solid, Ellipsoid):
        return (around + up) * max(solid.radius_x_m, solid.radius_y_m, solid.radius_z_m)
    return around * solid.radius_m


def _box(box: Box) -> F64:
    c, s = math.cos(box.yaw_rad), math.sin(box.yaw_rad)
    corners = []
    for z in (box.z_m, box.z_m + box.height_m):
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            along, across = a * box.length_m / 2, b * box.width_m / 2
            corners.append((box.x_m + c * along - s * across, box.y_m + s * along + c * across, z))
    sides = [(k, (k + 1) % 4, (k + 1) % 4 + 4) for k in range(4)]
    sides += [(k, (k + 1) % 4 + 4, k + 4) for k in range(4)]
    faces: F64 = np.array(corners)[np.array([*_FACES, *sides])]
    return faces


def _ring(count: int) -> F64:
    turns = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(turns), np.sin(turns)])


def _tube(ring: F64, low: float, high: float) -> F64:
    """Return an upright tube over a ring of points (n, 2), with flat ends."""
    after, n = np.roll(ring, -1, axis=0), len(ring)
    middle = np.tile(ring.mean(axis=0), (n, 1))

    def at(points: F64, z: float) -> F64:
        return np.column_stack([points, np.full(n, z)])

    side = [
        (at(ring, low), at(after, low), at(after, high)),
        (at(ring, low), at(after, high), at(ring, high)),
    ]
    ends = [(at(middle, z), at(ring, z), at(after, z)) for z in (low, high)]
    return np.concatenate([np.stack(corners, axis=1) for corners in (*side, *ends)])


def _ellipsoid(solid: Ellipsoid) -> F64:
    ring, polar = _ring(AROUND), np.pi * np.arange(UP + 1) / UP
    unit = np.empty((UP + 1, AROUND, 3))
    unit[:, :, :2] = np.sin(polar)[:, np.newaxis, np.newaxis] * ring
    unit[:, :, 2] = np.cos(polar)[:, np.newaxis]
    points = unit * (solid.radius_x_m, solid.radius_y_m, solid.radius_z_m) + (solid.x_m, solid.y_m, solid.z_m)
    after = np.roll(points, -1, axis=1)
    upper = np.stack([points[:-1], points[1:], after[1:]], axis=2).reshape(-1, 3, 3)
    lower = np.stack([points[:-1], after[1:], after[:-1]], axis=2).reshape(-1, 3, 3)
    return np.concatenate([upper[AROUND:], lower[:-AROUND]])  # no faces without area at the poles


def _wire(wire: Wire) -> F64:
    """Return the tube without its ends."""
    a, b = np.array(wire.start_enu_m), np.array(wire.end_enu_m)
    along = (b - a) / np.linalg.norm(b - a)
    aside = np.cross(along, (0.0, 0.0, 1.0))
    aside /= np.linalg.norm(aside)
    ring = wire.radius_m * (_ring(AROUND) @ np.stack([aside, np.cross(aside, along)]))
    after = np.roll(ring, -1, axis=0)
    faces = [(a + ring, a + after, b + after), (a + ring, b + after, b + ring)]
    return np.concatenate([np.stack(corners, axis=1) for corners in faces])
