"""Exact surface on a fine grid, without missing thin objects between two samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sitl.world.primitives import Box, Cylinder, Ellipsoid, Solid, Wire
from sitl.world.world import World

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

_BAND_ROWS = 256


def sample_top(world: World, xs: F64, ys: F64, pitch_m: float) -> tuple[F64, U8]:
    """Return height and material on a regular grid, (ny, nx), NaN outside the world.

    Each sample represents a square of side pitch_m. Solids narrower than two squares (posts, wires, thin
    walls) raise every square they touch to their full height, even between sample centres.
    """
    z, kind = np.empty((ys.size, xs.size)), np.empty((ys.size, xs.size), np.uint8)
    for row in range(0, ys.size, _BAND_ROWS):
        band = slice(row, row + _BAND_ROWS)
        z[band], kind[band] = world.surface(xs[np.newaxis, :], ys[band, np.newaxis])
    movers = [part for mover in world.movers.values() for part in mover.placed()]
    for solid in (*world.solids, *movers):
        if _width_m(solid) < 2.0 * pitch_m:
            _raise(z, kind, xs, ys, pitch_m, solid)
    return z, kind


def _width_m(solid: Solid) -> float:
    if isinstance(solid, Box):
        return min(solid.length_m, solid.width_m)
    if isinstance(solid, Ellipsoid):
        return 2.0 * min(solid.radius_x_m, solid.radius_y_m)
    return 2.0 * solid.radius_m


def _raise(z: F64, kind: U8, xs: F64, ys: F64, pitch_m: float, solid: Solid) -> None:
    x0, y0, _, x1, y1, _ = solid.bounds()
    columns = slice(*np.searchsorted(xs, [x0 - pitch_m, x1 + pitch_m]))
    rows = slice(*np.searchsorted(ys, [y0 - pitch_m, y1 + pitch_m]))
    x, y = np.meshgrid(xs[columns], ys[rows])
    if x.size == 0:
        return
    top = _touched_top(solid, x, y, pitch_m / 2)
    window = (rows, columns)
    higher = np.isfinite(z[window]) & (top > z[window])
    z[window] = np.where(higher, top, z[window])
    kind[window] = np.where(higher, np.uint8(solid.kind), kind[window])


def _touched_top(solid: Solid, x: F64, y: F64, half_m: float) -> F64:
    """Return the top of a solid for every square (centre x, y) it touches, -inf elsewhere."""
    if isinstance(solid, Wire):
        return _wire_top(solid, x, y, half_m)
    dx, dy = x - solid.x_m, y - solid.y_m
    top = solid.bounds()[5]
    if isinstance(solid, Box):
        c, s = np.cos(solid.yaw_rad), np.sin(solid.yaw_rad)
        grow = half_m * (abs(c) + abs(s))
        along, across = np.abs(c * dx + s * dy), np.abs(c * dy - s * dx)
        touched = (along <= solid.length_m / 2 + grow) & (across <= solid.width_m / 2 + grow)
        return np.where(touched, top, -np.inf)
    radius = solid.radius_m if isinstance(solid, Cylinder) else max(solid.radius_x_m, solid.radius_y_m)
    beyond = np.hypot(np.maximum(np.abs(dx) - half_m, 0.0), np.maximum(np.abs(dy) - half_m, 0.0))
    return np.where(beyond <= radius, top, -np.inf)


def _wire_top(wire: Wire, x: F64, y: F64, half_m: float) -> F64:
    (ax, ay, az), (bx, by, bz) = wire.start_enu_m, wire.end_enu_m
    length = np.hypot(bx - ax, by - ay)
    ux, uy = (bx - ax) / length, (by - ay) / length
    along, across = (x - ax) * ux + (y - ay) * uy, (y - ay) * ux - (x - ax) * uy
    grow = half_m * (abs(ux) + abs(uy)) + wire.radius_m
    touched = (np.abs(across) <= grow) & (along >= -grow) & (along <= length + grow)
    share = np.clip(along / length, 0.0, 1.0)
    return np.where(touched, az + share * (bz - az) + wire.radius_m, -np.inf)
