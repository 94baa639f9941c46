"""Agreement of live returns with a prior survey."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D, Strided1D, Strided2D
from slz.kernels.jit import kernel


@kernel
def heights_over(
    points: Strided2D[np.float64],
    west: float,
    south: float,
    cell: float,
    safe: Array2D[np.uint8],
    height: Array2D[np.float32],
) -> Strided1D[np.float64]:
    """Return the heights of points over surveyed ground; NaN where it was not safe or not surveyed."""
    rows, cols = safe.shape
    out = np.full(len(points), np.nan)
    for i in range(len(points)):
        c = int(np.floor((points[i, 0] - west) / cell))
        r = int(np.floor((points[i, 1] - south) / cell))
        if 0 <= r < rows and 0 <= c < cols and safe[r, c] == 1:
            out[i] = points[i, 2] - height[r, c]
    return out


@kernel
def contradict(
    points: Strided2D[np.float64],
    over: Strided1D[np.float64],
    sensor: Strided1D[np.float64],
    offset_m: float,
    least_m: float,
    angle_noise_rad: float,
    west: float,
    south: float,
    cell: float,
    contradicted: Array2D[np.uint8],
) -> int:
    """Mark the cells of points that differ in height from surveyed ground; return how many are new.

    over: `heights_over`. offset_m: height of all ground over the survey. A point contradicts the survey when
    it differs by more than least_m plus four standard deviations of a height at its horizontal distance.
    """
    n = 0
    for i in range(len(points)):
        if np.isnan(over[i]):
            continue
        way = np.sqrt((points[i, 0] - sensor[0]) ** 2 + (points[i, 1] - sensor[1]) ** 2)
        if not abs(over[i] - offset_m) > least_m + 4 * angle_noise_rad * way:
            continue
        c = int(np.floor((points[i, 0] - west) / cell))
        r = int(np.floor((points[i, 1] - south) / cell))
        if contradicted[r, c] == 0:
            contradicted[r, c] = 1
            n += 1
    return n
