"""Which points have company."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

FINE, COARSE = 1, 7  # layers of voxels above and below
SURFACE = 100  # returns that make a surface
ENOUGH, CLEAR_M = 5, 2.0  # so many are an object wherever dust is not dense


@kernel("int64(uint16[:, :, :], int64, int64, int64, int64)")
def _within(count: NDArray[np.uint16], x: int, y: int, low: int, high: int) -> int:
    total = 0
    for a in range(x - 1, x + 2):
        for b in range(y - 1, y + 2):
            for c in range(low, high + 1):
                total += count[a, b, c]
    return total


@kernel("boolean[:](float64[:, :], float64[:], float64, int64, float64, int64)")
def has_company(
    points: NDArray[np.float64],
    sensor: NDArray[np.float64],
    voxel: float,
    least: int,
    object_m2: float,
    most_voxels: int,
) -> NDArray[np.bool_]:
    """Tell of every point whether enough others are near it, see `slz.outliers.in_company`.

    Voxels are a quarter as high as wide. Everything has company where there would be more than
    `most_voxels`.
    """
    n = len(points)
    keep = np.ones(n, np.bool_)
    if n == 0:
        return keep
    low, size = np.empty(3), np.empty(3, np.int64)
    edge = np.array([voxel, voxel, voxel / 4])
    volume = 1.0
    for axis in range(3):
        low[axis] = edge[axis] * np.floor(points[:, axis].min() / edge[axis])  # of the map, not of the points
        size[axis] = int((points[:, axis].max() - low[axis]) / edge[axis]) + 2 * COARSE + 1
        volume *= size[axis]
    if volume > most_voxels:
        return keep
    count = np.zeros((size[0], size[1], size[2]), np.uint16)
    for i in range(n):
        x = int((points[i, 0] - low[0]) / edge[0]) + COARSE
        y = int((points[i, 1] - low[1]) / edge[1]) + COARSE
        z = int((points[i, 2] - low[2]) / edge[2]) + COARSE
        if count[x, y, z] < 65535:
            count[x, y, z] += 1
    share = object_m2 * n / (4 * np.pi)
    for i in range(n):
        x = int((points[i, 0] - low[0]) / edge[0]) + COARSE
        y = int((points[i, 1] - low[1]) / edge[1]) + COARSE
        z = int((points[i, 2] - low[2]) / edge[2]) + COARSE
        dx, dy, dz = points[i, 0] - sensor[0], points[i, 1] - sensor[1], points[i, 2] - sensor[2]
        need, reach = least, COARSE
        near = share / max(dx * dx + dy * dy + dz * dz, 1e-2)
        if near > least:  # never so where the sensor is unknown, NaN
            most = ENOUGH if dx * dx + dy * dy + dz * dz > CLEAR_M * CLEAR_M else 10_000
            need, reach = min(int(near), most), FINE
        company = int(count[x, y, z])
        if company < need:
            company = level = _within(count, x, y, z - FINE, z + FINE)
            if company < need and reach > FINE:
                company = _within(count, x, y, z - reach, z + reach)
            if level < least and _within(count, x, y, z + FINE + 1, z + COARSE) >= SURFACE:
                company = 0  # alone on its level, close below a surface
        keep[i] = company >= need
    return keep
