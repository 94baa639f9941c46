"""Kernels of the step map: heights of cells, and how badly a shifted scan fits them."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array2D, ReadOnly1D, ReadOnly2D
from slz.kernels.jit import kernel

CELL_M = 0.2
SIDE = 1024  # cells: what is 205 m away takes the place of what was here
COARSE_SIDE = SIDE // 8
STRIDES = 5  # of the shifts, each of half a cell, to either side
SHIFTS = 2 * STRIDES + 1
REACH = 3  # cells to either side that a shift can reach
FEWEST = 3  # returns of a cell
# From the sensor, across: farther away a tilt of a degree raises the ground by more than half a metre.
FAR_M = 30.0
TOLERANCE_M = 0.15  # beyond the heights of a cell
WORST_M = 0.45  # beyond them, where a point fits no worse
SHADOW_M = 2.0  # from a point to the lowest about it, beyond which a cell not seen lies in its shadow
SHADOW = 0.8  # misfit of a point there
EMPTY = np.int64(-(2**63))  # key of no cell
_MASK, _COARSE_MASK = SIDE - 1, COARSE_SIDE - 1


@kernel
def insert(
    points_m: ReadOnly2D[np.float64],
    stamp_ns: int,
    hold_ns: int,
    keys: Array2D[np.int64],
    first_ns: Array2D[np.int64],
    counts: Array2D[np.int32],
    low_m: Array2D[np.float32],
    high_m: Array2D[np.float32],
    coarse_keys: Array2D[np.int64],
    lowest_m: Array2D[np.float32],
) -> None:
    """Widen the heights of the cells of points (n, 3), for `hold_ns` from each cell's first.

    `lowest_m` is the lowest of them within a coarse cell of 1.6 m and its neighbours.
    """
    for i in range(len(points_m)):
        x, y, z = math.floor(points_m[i, 0] / CELL_M), math.floor(points_m[i, 1] / CELL_M), points_m[i, 2]
        a, b, key = x & _MASK, y & _MASK, (x << 32) ^ (y & 0xFFFFFFFF)
        if keys[a, b] != key:
            keys[a, b], first_ns[a, b], counts[a, b], low_m[a, b], high_m[a, b] = key, stamp_ns, 1, z, z
            continue
        if stamp_ns - first_ns[a, b] > hold_ns:
            continue
        counts[a, b] += 1
        low_m[a, b], high_m[a, b] = min(low_m[a, b], z), max(high_m[a, b], z)
        if counts[a, b] != FEWEST:
            continue
        z = high_m[a, b]  # of single returns, some lie far below
        for u in range((x >> 3) - 1, (x >> 3) + 2):
            for v in range((y >> 3) - 1, (y >> 3) + 2):
                a, b, key = u & _COARSE_MASK, v & _COARSE_MASK, (u << 32) ^ (v & 0xFFFFFFFF)
                if coarse_keys[a, b] != key or z < lowest_m[a, b]:
                    coarse_keys[a, b], lowest_m[a, b] = key, z


@kernel
def misfits(
    points_m: ReadOnly2D[np.float64],
    pivot_m: ReadOnly1D[np.float64],
    stamp_ns: int,
    age_ns: int,
    keys: Array2D[np.int64],
    first_ns: Array2D[np.int64],
    counts: Array2D[np.int32],
    low_m: Array2D[np.float32],
    high_m: Array2D[np.float32],
    coarse_keys: Array2D[np.int64],
    lowest_m: Array2D[np.float32],
    misfit: Array2D[np.float64],
) -> tuple[int, float, float]:
    """Write the misfit (SHIFTS, SHIFTS) of points (n, 3) by shift; return the number used, and their middle.

    A point fits where it lies between the heights of its cell, seen first at least `age_ns` ago. It is
    used if it fits one of the cells about it well and another not at all, beside a step, and is near the
    pivot (3,), the sensor.
    """
    misfit[:, :] = 0.0
    patch = np.zeros((2 * REACH + 1, 2 * REACH + 1))
    used, east_m, north_m = 0, 0.0, 0.0
    for i in range(len(points_m)):
        if math.hypot(points_m[i, 0] - pivot_m[0], points_m[i, 1] - pivot_m[1]) > FAR_M:
            continue
        x, y, z = points_m[i, 0] / CELL_M, points_m[i, 1] / CELL_M, points_m[i, 2]
        ix, iy = math.floor(x), math.floor(y)
        best, worst, young = 1.0, 0.0, False
        for probe in range(2):  # the corners and the middle tell most points far from a step
            stride = REACH if probe == 0 else 1
            for c in range(-REACH, REACH + 1, stride):
                for d in range(-REACH, REACH + 1, stride):
                    a, b = ix + c, iy + d
                    u, v = a & _MASK, b & _MASK
                    fit = 0.0
                    if keys[u, v] != ((a << 32) ^ (b & 0xFFFFFFFF)):
                        a, b = a >> 3, b >> 3
                        u, v = a & _COARSE_MASK, b & _COARSE_MASK
                        known = coarse_keys[u, v] == ((a << 32) ^ (b & 0xFFFFFFFF))
                        if known and z - lowest_m[u, v] > SHADOW_M:
                            fit = SHADOW
                    elif stamp_ns - first_ns[u, v] < age_ns:
                        young = True
                    elif counts[u, v] >= FEWEST:
                        away = max(z - high_m[u, v], low_m[u, v] - z) - TOLERANCE_M
                        fit = min(max(away / (WORST_M - TOLERANCE_M), 0.0), 1.0)
                        best = min(best, fit)
                    patch[c + REACH, d + REACH] = fit
                    worst = max(worst, fit)
            if young or worst < SHADOW or best > 0.0:
                break
        if young or worst < SHADOW or best > 0.0:
            continue
        used += 1
        east_m += points_m[i, 0]
        north_m += points_m[i, 1]
        for k in range(SHIFTS):
            a = math.floor(x + (k - STRIDES) / 2) - ix + REACH
            for m in range(SHIFTS):
                misfit[k, m] += patch[a, math.floor(y + (m - STRIDES) / 2) - iy + REACH]
    return used, east_m / max(used, 1), north_m / max(used, 1)
