"""Which points have company."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

FINE, COARSE = 1, 7  # layers of voxels above and below
SURFACE = 100  # returns that make a surface
ENOUGH, CLEAR_M = 5, 2.0  # so many are an object wherever dust is not dense


@kernel("int64(int64[::1], int64, int64, int64)")
def _slot(keys: NDArray[np.int64], x: int, y: int, z: int) -> int:
    """Return where a voxel is in the table, or the empty place where it would be.

    Voxels of a column lie side by side, as they are asked for.
    """
    mask = len(keys) - 1
    key = (x << 42) | (y << 21) | z
    slot = (((x << 21) | y) * 0x5851F42D4C957F2D >> 24) + z & mask
    while keys[slot] != key and keys[slot] >= 0:
        slot = slot + 1 & mask
    return slot


@kernel("int64(int64[::1], int32[::1], int64, int64, int64, int64)")
def _within(keys: NDArray[np.int64], count: NDArray[np.int32], x: int, y: int, low: int, high: int) -> int:
    total = 0
    for a in range(x - 1, x + 2):
        for b in range(y - 1, y + 2):
            for c in range(low, high + 1):
                slot = _slot(keys, a, b, c)
                if keys[slot] >= 0:
                    total += count[slot]
    return total


@kernel("boolean[:](float64[:, :], float64[:], float64, int64, float64)")
def has_company(
    points: NDArray[np.float64], sensor: NDArray[np.float64], voxel: float, least: int, object_m2: float
) -> NDArray[np.bool_]:
    """Tell of every point whether enough others are near it, see `slz.outliers.in_company`.

    Voxels are a quarter as high as wide, and counted in a hash table: the volume they span does not matter.
    """
    n = len(points)
    keep = np.ones(n, np.bool_)
    if n == 0:
        return keep
    edge = np.array([voxel, voxel, voxel / 4])
    low = np.empty(3)
    for axis in range(3):
        low[axis] = edge[axis] * np.floor(points[:, axis].min() / edge[axis])  # of the map, not of the points
    size = 64
    while size < 4 * n:
        size *= 2
    keys, count = np.full(size, -1, np.int64), np.zeros(size, np.int32)
    at = np.empty((n, 3), np.int64)
    own = np.empty(n, np.int64)
    for i in range(n):
        for axis in range(3):
            at[i, axis] = int((points[i, axis] - low[axis]) / edge[axis]) + COARSE
        slot = _slot(keys, at[i, 0], at[i, 1], at[i, 2])
        keys[slot] = (at[i, 0] << 42) | (at[i, 1] << 21) | at[i, 2]
        count[slot] += 1
        own[i] = slot
    share = object_m2 * n / (4 * np.pi)
    for i in range(n):
        x, y, z = at[i]
        dx, dy, dz = points[i, 0] - sensor[0], points[i, 1] - sensor[1], points[i, 2] - sensor[2]
        need, reach = least, COARSE
        near = share / max(dx * dx + dy * dy + dz * dz, 1e-2)
        if near > least:  # never so where the sensor is unknown, NaN
            most = ENOUGH if dx * dx + dy * dy + dz * dz > CLEAR_M * CLEAR_M else 10_000
            need, reach = min(int(near), most), FINE
        company = int(count[own[i]])
        if company < need:
            company = level = _within(keys, count, x, y, z - FINE, z + FINE)
            if company < need and reach > FINE:
                company = _within(keys, count, x, y, z - reach, z + reach)
            if level < least and _within(keys, count, x, y, z + FINE + 1, z + COARSE) >= SURFACE:
                company = 0  # alone on its level, close below a surface
        keep[i] = company >= need
    return keep
