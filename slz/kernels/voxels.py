"""Which points have company."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel


@kernel("boolean[:](float64[:, :], float64, int64, int64)")
def has_company(points: NDArray[np.float64], voxel: float, least: int, most_voxels: int) -> NDArray[np.bool_]:
    """Tell of every point whether the 3 x 3 x 3 voxels around it hold `least` points, itself included.

    Everything has company where the points span more than `most_voxels`.
    """
    n = len(points)
    keep = np.ones(n, np.bool_)
    if n == 0:
        return keep
    low, size = np.empty(3), np.empty(3, np.int64)
    volume = 1.0
    for axis in range(3):
        low[axis] = points[:, axis].min()
        size[axis] = int((points[:, axis].max() - low[axis]) / voxel) + 3
        volume *= size[axis]
    if volume > most_voxels:
        return keep
    count = np.zeros((size[0], size[1], size[2]), np.uint8)
    for i in range(n):
        x = int((points[i, 0] - low[0]) / voxel) + 1
        y = int((points[i, 1] - low[1]) / voxel) + 1
        z = int((points[i, 2] - low[2]) / voxel) + 1
        if count[x, y, z] < 255:
            count[x, y, z] += 1
    for i in range(n):
        x = int((points[i, 0] - low[0]) / voxel) + 1
        y = int((points[i, 1] - low[1]) / voxel) + 1
        z = int((points[i, 2] - low[2]) / voxel) + 1
        company = int(count[x, y, z])
        if company < least:
            company = 0
            for a in range(x - 1, x + 2):
                for b in range(y - 1, y + 2):
                    for c in range(z - 1, z + 2):
                        company += count[a, b, c]
        keep[i] = company >= least
    return keep
