"""Elevation map of a scene, removal of the ground, and elevation histogram (Flash paper, section 5.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slz.grid import Grid
from slz.kernels.cells.accumulate import sum_and_count

F64 = NDArray[np.float64]
GROUND_M = 8.0
"""Side of the square whose median is the ground: half of it must be free of objects."""
BLOCK_M = 0.5


@dataclass(frozen=True, slots=True)
class ElevationMap:
    """Heights of cells; arrays [row = y, col = x].

    height_m : float64, mean of the points of each cell, NaN without points. count : int32 points.
    """

    grid: Grid
    height_m: F64
    count: NDArray[np.int32]


def elevation_map(points_m: F64, grid: Grid) -> ElevationMap:
    """Return the mean height of the points in every cell of a grid."""
    total, count = np.zeros((grid.rows, grid.cols)), np.zeros((grid.rows, grid.cols), np.int32)
    points = np.ascontiguousarray(points_m)
    sum_and_count(points, grid.west_m, grid.south_m, grid.cell_m, 0, 0, total, count)
    with np.errstate(invalid="ignore"):
        return ElevationMap(grid, total / np.where(count, count, np.nan), count)


def grid_around(points_m: F64, cell_m: float) -> Grid:
    """Return the smallest grid of whole cells that holds all points.

    Raises
    ------
    ValueError
        There is no point.
    """
    if not len(points_m):
        raise ValueError("flash: no point to lay a grid around; every frame was dropped or out of range")
    low = np.floor(points_m[:, :2].min(axis=0) / cell_m) * cell_m
    cols, rows = (np.floor((points_m[:, :2].max(axis=0) - low) / cell_m).astype(int) + 1).tolist()
    return Grid(float(low[0]), float(low[1]), cell_m, rows, cols)


def relative_elevation(elevation: ElevationMap, ground_m: float = GROUND_M) -> F64:
    """Return the DEM: elevations minus those of the object-free ground around (Flash paper, section 5.3).

    The source subtracts one mean of areas without objects. Undulating ground needs a local one: the median of
    blocks of 0.5 m over `ground_m`, which is unaffected by objects on less than half of that square.
    """
    cell = elevation.grid.cell_m
    step = max(1, round(BLOCK_M / cell))
    rows, cols = elevation.height_m.shape
    padded = np.full((-(-rows // step) * step, -(-cols // step) * step), np.nan)
    padded[:rows, :cols] = elevation.height_m
    blocks = padded.reshape(padded.shape[0] // step, step, padded.shape[1] // step, step)
    coarse = _median(blocks.swapaxes(1, 2).reshape(*blocks.shape[::2], step * step))
    side = max(3, round(ground_m / (step * cell)) | 1)
    half = side // 2
    wide = np.pad(coarse, half, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(wide, (side, side))
    ground = _median(windows.reshape(*coarse.shape, side * side))
    smooth = _smoothed(ground)
    at_row, at_col = ((np.arange(n) + 0.5) / step - 0.5 for n in (rows, cols))
    where = np.meshgrid(at_row, at_col, indexing="ij")
    below = ndimage.map_coordinates(smooth, where, order=1, mode="nearest")
    return np.asarray(elevation.height_m - below)


def _median(values: F64) -> F64:
    """Return medians of the known values along the last axis; inf where none is known."""
    return np.asarray(
        np.nanmedian(np.where(np.isnan(values).all(-1, keepdims=True), np.inf, values), axis=-1)
    )


def _smoothed(ground: F64) -> F64:
    """Return the smoothed ground; unknown cells take the nearest known value."""
    unknown = ~np.isfinite(ground)
    if unknown.all():
        return np.full_like(ground, np.nan)
    nearest = ndimage.distance_transform_edt(unknown, return_distances=False, return_indices=True)
    return np.asarray(ndimage.gaussian_filter(ground[tuple(nearest)], 1.0, mode="nearest"))


def histogram_peaks(
    heights_m: F64, bin_m: float = 0.05, least_share: float = 0.01, apart_m: float = 0.3
) -> F64:
    """Return the heights (m), ascending, of the peaks of a histogram of elevations (Flash paper, Fig. 7b).

    A peak is the highest bin within `apart_m`, and holds with its neighbours at least `least_share` of the
    cells. Its height is the mean of the values in these bins.
    """
    values = heights_m[np.isfinite(heights_m)]
    if not len(values):
        return np.empty(0)
    first = np.floor(values.min() / bin_m) - 1
    count = np.bincount((np.floor(values / bin_m) - first).astype(int), minlength=3)
    count = np.append(count, 0)
    reach = max(1, round(apart_m / bin_m))
    highest = ndimage.maximum_filter1d(count, 2 * reach + 1, mode="constant")
    near = np.convolve(count, np.ones(3), "same")
    found = np.flatnonzero((count == highest) & (near >= least_share * len(values)))
    peaks = []
    for k in found:
        low = (first + k - 1) * bin_m
        peaks.append(float(values[(values >= low) & (values < low + 3 * bin_m)].mean()))
    return np.array([p for i, p in enumerate(peaks) if i == 0 or p - peaks[i - 1] > apart_m])
