"""Point density of a cloud, and the width of gaps that chance alone explains at that density."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

BLOCK_M = 5.0
EMPTY = 0.005  # share of squares that may be empty by chance in ground that counts as covered


def density_per_m2(points_m: NDArray[np.float64]) -> float:
    """Return the median density over the blocks of 5 m that hold points; 0 without points."""
    if not len(points_m):
        return 0.0
    blocks = np.floor((points_m[:, :2] - points_m[:, :2].min(axis=0)) / BLOCK_M).astype(np.int64)
    _, count = np.unique(blocks[:, 0] * (blocks[:, 1].max() + 1) + blocks[:, 1], return_counts=True)
    return float(np.median(count)) / BLOCK_M**2


def coverage_for(density: float, cell_m: float, least_m: float, most_m: float) -> float:
    """Return the width (m) of gaps that chance alone leaves at this density, an odd number of cells.

    Returns fall as a Poisson process: a square of side w is empty with probability exp(-density w²). The
    width is at least `least_m`. It is at most `most_m`: ground with wider gaps stays unknown.
    """
    if density <= 0:
        return least_m
    width = math.sqrt(-math.log(EMPTY) / density)
    cells = math.ceil(width / cell_m - 1e-9)
    return max(least_m, min((cells + 1 - cells % 2) * cell_m, most_m))
