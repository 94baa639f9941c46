"""How dense a cloud is, and how wide a gap in it says nothing."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

BLOCK_M = 5.0
EMPTY = 0.005  # share of squares without a return, at random, that counts as covered all the same


def density_per_m2(points_m: NDArray[np.float64]) -> float:
    """Return the median density of the ground that holds points, from blocks of 5 m; 0 without points."""
    if not len(points_m):
        return 0.0
    blocks = np.floor((points_m[:, :2] - points_m[:, :2].min(axis=0)) / BLOCK_M).astype(np.int64)
    _, count = np.unique(blocks[:, 0] * (blocks[:, 1].max() + 1) + blocks[:, 1], return_counts=True)
    return float(np.median(count)) / BLOCK_M**2


def coverage_for(density: float, cell_m: float, least_m: float, most_m: float) -> float:
    """Return the width of gaps that chance alone leaves in so dense a cloud, in an odd number of cells.

    Returns fall as a Poisson process: a square of side w is empty with probability exp(-density w²).
    Never below `least_m`, and never above `most_m`: ground with wider gaps stays unknown.
    """
    if density <= 0:
        return least_m
    width = math.sqrt(-math.log(EMPTY) / density)
    cells = math.ceil(width / cell_m - 1e-9)
    return max(least_m, min((cells + 1 - cells % 2) * cell_m, most_m))
