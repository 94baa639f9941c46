"""Quality of a cloud before it is mapped: stray points, density, steps of its coordinates."""

from __future__ import annotations

import logging
import math

import numpy as np
from numpy.typing import NDArray

from companion.runtime.errors import UsageError
from params import Parameters

BLOCK_M = 5.0
EMPTY = 0.005  # share of squares that may be empty by chance in ground that counts as covered

CORE = 0.99  # share of points that define the extent of a cloud
REACH = 10.0  # a stray is farther from the median than this multiple of the core's reach
HIGHEST_M = 20_000.0  # no ground, cloud or aircraft with a LiDAR is higher or deeper

log = logging.getLogger(__name__)

COARSE = 0.25  # of a cell: beyond that, the user is warned


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


def check_steps(
    owner: str,
    scales: tuple[float, float, float],
    lengths_m: tuple[float, float, float],
    parameters: Parameters,
) -> None:
    """Refuse steps of x or y longer than a cell, and steps of height that hide a slope from a footprint.

    Ground stored in steps of more than `relief_m` looks level between two steps.

    Parameters
    ----------
    owner
        File, for the error.
    scales
        Steps of x, y and z, in units of the CRS; 0 for floating point numbers.
    lengths_m
        Metres of one unit of x, y and z.

    Raises
    ------
    UsageError
        The steps are too coarse.
    """
    x_m, y_m, z_m = (scale * length for scale, length in zip(scales, lengths_m, strict=True))
    side_m, cell_m = max(x_m, y_m), parameters.cell_m
    listed = ", ".join(f"{scale:g}" for scale in scales)
    if side_m > cell_m:
        raise UsageError(
            f"{owner}: its scales {listed} put x and y {side_m:.3g} m apart, more than a cell of {cell_m:g}"
            " m: write it again with finer scales (1e-7 for degrees)"
        )
    if z_m > parameters.relief_m:
        raise UsageError(
            f"{owner}: its scales {listed} put heights {z_m:.3g} m apart, more than relief_m of"
            f" {parameters.relief_m:g} m, so that slopes look level: write it again with a finer scale of z"
        )
    if side_m > COARSE * cell_m:
        log.warning("%s: its scales %s put x and y %.3g m apart: write finer ones", owner, listed, side_m)
