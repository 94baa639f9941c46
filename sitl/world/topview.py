"""Top view of the world: exact surface heights without rays.

It shares only the tables with the ray caster, so that each can verify the other.
"""

from __future__ import annotations

import math

import numpy as np

from sitl.array_types import Array1D
from sitl.compilation import kernel, kernel_part
from sitl.world.tables import F64, INF, GridTable, GroundTable, MoverTable, SolidTable


@kernel_part
def _top(shape: int, p: F64, i: int, x: float, y: float) -> float:
    """Return the height of the top of solid i above (x, y), -inf beside it."""
    rx, ry = x - p[i, 0], y - p[i, 1]
    if shape == 0:
        c, s = p[i, 6], p[i, 7]
        inside = abs(c * rx + s * ry) <= p[i, 4] and abs(c * ry - s * rx) <= p[i, 5]
        return p[i, 3] if inside else -INF
    if shape == 1:
        return p[i, 3] if rx * rx + ry * ry <= p[i, 4] * p[i, 4] else -INF
    if shape == 2:
        rest = 1.0 - (rx / p[i, 3]) ** 2 - (ry / p[i, 4]) ** 2
        return p[i, 2] + p[i, 5] * math.sqrt(rest) if rest >= 0.0 else -INF
    return _wire_top(p, i, rx, ry)


@kernel_part
def _wire_top(p: F64, i: int, rx: float, ry: float) -> float:
    ax, ay, az = p[i, 3] - p[i, 0], p[i, 4] - p[i, 1], p[i, 5] - p[i, 2]
    flat2 = ax * ax + ay * ay
    across = (rx * ay - ry * ax) / math.sqrt(flat2)
    rest = p[i, 6] * p[i, 6] - across * across
    if rest < 0.0:
        return -INF
    # A vertical line cuts an inclined tube in an ellipse: the half height grows by 1 / cos(inclination).
    half = math.sqrt(rest * (flat2 + az * az) / flat2)
    along = (rx * ax + ry * ay) / flat2
    axial = along + half * az / (flat2 + az * az)
    return p[i, 2] + along * az + half if 0.0 <= axial <= 1.0 else -INF


@kernel
def top_surface(
    ground: GroundTable,
    solids: SolidTable,
    grid: GridTable,
    movers: MoverTable,
    xs: Array1D[np.float64],
    ys: Array1D[np.float64],
    out_z: Array1D[np.float64],
    out_kind: Array1D[np.uint8],
) -> None:
    """Write the height and material seen from straight above; NaN and 0 outside the world."""
    z, _, meta = ground
    cell = grid[0][0]
    x1 = meta[0] + (z.shape[1] - 1) * meta[2]
    y1 = meta[1] + (z.shape[0] - 1) * meta[2]
    n_y, n_x = grid[2].shape
    for n in range(xs.size):
        x, y = xs[n], ys[n]
        out_z[n], out_kind[n] = math.nan, 0
        if not (meta[0] <= x <= x1 and meta[1] <= y <= y1):
            continue
        u, v = (x - meta[0]) / meta[2], (y - meta[1]) / meta[2]
        i, j = min(int(u), z.shape[1] - 2), min(int(v), z.shape[0] - 2)
        u, v = u - i, v - j
        low = z[j, i] * (1 - u) + z[j, i + 1] * u
        high = z[j + 1, i] * (1 - u) + z[j + 1, i + 1] * u
        best, kind = low * (1 - v) + high * v, ground[1][j, i]
        ix = min(int((x - meta[0]) / cell), n_x - 1)
        iy = min(int((y - meta[1]) / cell), n_y - 1)
        flat = iy * n_x + ix
        for k in range(grid[3][flat], grid[3][flat + 1]):
            s = grid[4][k]
            top = _top(solids[0][s], solids[1], s, x, y)
            if top > best:
                best, kind = top, solids[2][s]
        for m in range(movers[0].size):
            top = _top(movers[0][m], movers[1], m, x, y)
            if top > best:
                best, kind = top, movers[2][m]
        out_z[n], out_kind[n] = best, kind
