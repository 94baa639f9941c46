"""Removal of stray points: gross outliers such as zeros, overflows, and errors of other programs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

CORE = 0.99  # share of points that define the extent of a cloud
REACH = 10.0  # a stray is farther from the median than this multiple of the core's reach
HIGHEST_M = 20_000.0  # no ground, cloud or aircraft with a LiDAR is higher or deeper


def inlier_mask(points: NDArray[np.float64], z_m: float) -> NDArray[np.bool_]:
    """Return a mask (n,) of the (n, 3) finite points that belong to the cloud.

    Along each axis, a stray is farther from the median than ten times the distance that holds 99 % of the
    points. Points 20 km or more above or below zero are strays, too. z_m: metres per unit of z.
    """
    keep = np.abs(points[:, 2] * z_m) < HIGHEST_M
    for axis in (0, 1):
        values = points[:, axis]
        distance = np.abs(values - np.median(values))
        reach = np.quantile(distance, CORE, method="lower")
        if reach > 0:
            keep &= distance <= REACH * reach
    return keep
