"""Points that lie nowhere near the others: zeros, overflows, mistakes of other programs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

CORE = 0.99  # share of points that say how large a cloud is
REACH = 10.0  # farther than so many times the core's reach is astray
HIGHEST_M = 20_000.0  # no ground, cloud or aircraft with a LiDAR is higher or deeper


def near(points: NDArray[np.float64], z_m: float) -> NDArray[np.bool_]:
    """Tell which of (n, 3) finite points belong to the cloud.

    A point is astray when it is farther from the median than ten times the distance, measured along each
    axis, that holds 99 % of the points, or higher than 20 km. z_m: metres per unit of z.
    """
    keep = np.abs(points[:, 2] * z_m) < HIGHEST_M
    for axis in (0, 1):
        values = points[:, axis]
        distance = np.abs(values - np.median(values))
        reach = np.quantile(distance, CORE, method="lower")
        if reach > 0:
            keep &= distance <= REACH * reach
    return keep
