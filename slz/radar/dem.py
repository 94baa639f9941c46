"""Ground-range DEMs with standard deviations, single and fused (Radar letter, section 3.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.grid import Grid
from slz.kernels.instruments.dem_fusion import (
    SUM_HEIGHT,
    SUM_SQUARE,
    SUM_TURN,
    SUM_VARIANCE,
    SUM_WEIGHT,
    add_samples,
    fuse_cells,
)
from slz.radar.heights import LEAST_COHERENCE, Heights, heights
from slz.radar.interferogram import RadarLines, interferogram
from slz.radar.interferometer import Interferometer

F64 = NDArray[np.float64]
MOST_SIGMA_M = 0.25
"""Standard deviation above which a cell is unknown."""
APART_M = 0.3
"""Difference above which two heights of one cell are distinct."""


@dataclass(frozen=True, slots=True)
class RadarDem:
    """Heights of cells with their standard deviations, both NaN where unknown; arrays [row = y, col = x], m.

    turn_m : height of a whole turn of the phase, NaN where several observations were fused.
    """

    grid: Grid
    height_m: F64
    sigma_m: F64
    turn_m: F64

    def points(self) -> tuple[F64, F64]:
        """Return the centres (n, 3) of the known cells, and their standard deviations (n,)."""
        row, col = np.nonzero(np.isfinite(self.height_m))
        g = self.grid
        east, north = g.west_m + (col + 0.5) * g.cell_m, g.south_m + (row + 0.5) * g.cell_m
        return np.column_stack([east, north, self.height_m[row, col]]), self.sigma_m[row, col]


def observe(
    lines: RadarLines,
    radar: Interferometer,
    grid: Grid,
    *,
    common_band: bool = True,
    least_coherence: float = LEAST_COHERENCE,
) -> RadarDem:
    """Return the DEM of one observation from its complex images; pixels of less coherence are unknown."""
    image = interferogram(lines, radar, common_band)
    return grid_heights(heights(image, lines, radar, least_coherence), radar, grid)


def grid_heights(found: Heights, radar: Interferometer, grid: Grid) -> RadarDem:
    """Return the DEM of one observation's points.

    Samples overlap, so those of one cell are not independent: the cell's standard deviation is that of one
    sample, with the scatter of the samples added.
    """
    sums = np.zeros((grid.rows, grid.cols, 5))
    add_samples(
        found.points_m, found.sigma_m, found.turn_m, found.ahead, radar.azimuth_m,
        grid.west_m, grid.south_m, grid.cell_m, sums,
    )  # fmt: skip
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = sums[..., SUM_HEIGHT] / sums[..., SUM_WEIGHT]
        scatter = np.maximum(sums[..., SUM_SQUARE] / sums[..., SUM_WEIGHT] - mean**2, 0.0)
        sigma = np.sqrt(sums[..., SUM_VARIANCE] / sums[..., SUM_WEIGHT] + scatter)
        turn = sums[..., SUM_TURN] / sums[..., SUM_WEIGHT]
    return _certain(RadarDem(grid, mean, sigma, turn))


def fuse(observations: Sequence[RadarDem], least: int | None = None) -> RadarDem:
    """Fuse observations of one grid by weight, and resolve their phase ambiguities against each other.

    Parameters
    ----------
    least
        Observations that must agree on a cell's height; by default more than half of them. On a crate
        about as high as a turn of the phase, a single observation may see level ground.

    Raises
    ------
    ValueError
        There is none, or they are of different grids.
    """
    if not observations:
        raise ValueError("radar: no observation to fuse")
    grid = observations[0].grid
    if any(o.grid != grid for o in observations):
        raise ValueError("radar: the observations have different grids: lay all on one before they are fused")
    stack = [
        np.ascontiguousarray(np.stack(part))
        for part in zip(*((o.height_m, o.sigma_m, o.turn_m) for o in observations), strict=True)
    ]
    height, sigma = np.empty((grid.rows, grid.cols)), np.empty((grid.rows, grid.cols))
    least = len(observations) // 2 + 1 if least is None else least
    fuse_cells(stack[0], stack[1], stack[2], least, APART_M, height, sigma)
    return _certain(RadarDem(grid, height, sigma, np.full_like(height, np.nan)))


def _certain(dem: RadarDem) -> RadarDem:
    with np.errstate(invalid="ignore"):
        doubtful = ~(dem.sigma_m < MOST_SIGMA_M)
    for layer in (dem.height_m, dem.sigma_m, dem.turn_m):
        layer[doubtful] = np.nan
    return dem
