"""Elevation statistics of cells, and the step from cells to footprints, which most methods share."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, maximum_filter, uniform_filter
from scipy.spatial import KDTree

from companion.desk.open_benchmark.landing_task import (
    F32,
    F64,
    SAFE,
    U8,
    UNKNOWN,
    UNSAFE,
    CellGrid,
    FlownReturns,
    LandingTask,
)

Mask = NDArray[np.bool_]

NEIGHBOURS, DEVIATIONS = 8, 2.0  # of those tried, with these the methods miss least and find most


@dataclass(frozen=True, slots=True)
class CellStatistics:
    """Heights per cell, (rows, cols): number, mean, variance, lowest and highest; NaN where it is empty."""

    count: NDArray[np.int64]
    mean_m: F64
    variance_m2: F64
    lowest_m: F64
    highest_m: F64


def cell_statistics(returns: FlownReturns, grid: CellGrid) -> CellStatistics:
    """Return the statistics of the returns in each cell."""
    x, y, z = returns.points_m.T
    row, col, inside = grid.index(x, y)
    at, z = (row * grid.cols + col)[inside], z[inside]
    size = grid.rows * grid.cols
    count = np.bincount(at, minlength=size)
    lowest, highest = np.full(size, np.inf), np.full(size, -np.inf)
    np.minimum.at(lowest, at, z)
    np.maximum.at(highest, at, z)
    empty = count == 0
    n = np.where(empty, 1, count)
    mean = np.bincount(at, z, size) / n
    variance = np.bincount(at, (z - mean[at]) ** 2, size) / n
    values = (np.where(empty, np.nan, v).reshape(grid.shape) for v in (mean, variance, lowest, highest))
    return CellStatistics(count.reshape(grid.shape), *values)


def fill_gaps(height_m: F64, most_cells: float) -> F64:
    """Return heights in which empty cells take the nearest one within a distance."""
    empty = np.isnan(height_m)
    if empty.all() or not empty.any():
        return height_m
    apart, (row, col) = distance_transform_edt(empty, return_indices=True)
    return np.asarray(np.where(apart <= most_cells, height_m[row, col], np.nan))


def median_of_nine(height_m: F64) -> F64:
    """Return the median of the known heights among each cell and its neighbours; NaN where none is known."""
    near = around(height_m, 1).reshape(*height_m.shape, 9)
    ordered = np.sort(near, axis=-1)  # NaN last
    known = np.isfinite(ordered).sum(axis=-1)
    pick = np.maximum(known - 1, 0)
    low = np.take_along_axis(ordered, (pick // 2)[..., None], -1)[..., 0]
    high = np.take_along_axis(ordered, ((pick + 1) // 2)[..., None], -1)[..., 0]
    return (low + high) / 2


def footprint_planes(returns: FlownReturns, grid: CellGrid, reach: int) -> tuple[F64, F64, F64, F64]:
    """Return the least-squares planes of the returns of each footprint.

    Returns (rows, cols) number of returns, height at the centre, gradients in x and y; NaN without a plane.
    """
    x, y, z = returns.points_m.T
    row, col, inside = grid.index(x, y)
    at = (row * grid.cols + col)[inside]
    x, y, z = x[inside] - grid.west_m, y[inside] - grid.south_m, z[inside]
    size = 2 * reach + 1

    def total(values: F64) -> F64:
        sums = np.bincount(at, values, grid.rows * grid.cols).reshape(grid.shape)
        sums = uniform_filter(sums, size, mode="constant")
        return np.asarray(sums * size**2, np.float64)

    n = np.rint(total(np.ones(len(x))))
    some = np.maximum(n, 1)
    mx, my, mz = total(x) / some, total(y) / some, total(z) / some
    xx, yy, xy = (total(a) / some for a in (x * x, y * y, x * y))
    xz, yz = total(x * z) / some, total(y * z) / some
    xx, yy, xy, xz, yz = xx - mx * mx, yy - my * my, xy - mx * my, xz - mx * mz, yz - my * mz
    det = xx * yy - xy * xy
    with np.errstate(divide="ignore", invalid="ignore"):
        gx, gy = (yy * xz - xy * yz) / det, (xx * yz - xy * xz) / det
    flat = det < 1e-6
    gx[flat] = gy[flat] = np.nan
    east, north = grid.centres()
    level = mz + gx * (east - grid.west_m - mx) + gy * (north - grid.south_m - my)
    return n, level, gx, gy


def footprint_relief(returns: FlownReturns, grid: CellGrid, reach: int, level: F64, gx: F64, gy: F64) -> F64:
    """Return the range of the lowest and highest returns of cells about each plane; NaN without returns."""
    cells = cell_statistics(returns, grid)
    low, high = around(cells.lowest_m, reach), around(cells.highest_m, reach)
    offset = np.arange(-reach, reach + 1) * grid.cell_m
    most, least = np.full(grid.shape, -np.inf), np.full(grid.shape, np.inf)
    for i, north in enumerate(offset):
        for j, east in enumerate(offset):
            plane = level + gx * east + gy * north
            most = np.fmax(most, high[..., i, j] - plane)
            least = np.fmin(least, low[..., i, j] - plane)
    return np.where(np.isfinite(most), most - least, np.nan)


def around(values: F64, reach: int) -> F64:
    """Return (rows, cols, m, m) views of each cell's neighbourhood; NaN beyond the grid."""
    padded = np.pad(values, reach, constant_values=np.nan)
    return sliding_window_view(padded, (2 * reach + 1, 2 * reach + 1))


def footprint_reach(task: LandingTask, cell_m: float) -> int:
    """Return the number of cells on either side of the middle one that a footprint meets."""
    return int(np.ceil(task.footprint_m / 2 / cell_m - 0.5 - 1e-9))


def footprint_state(safe: Mask, unsafe: Mask, reach: int) -> U8:
    """Return the states of footprints: unsafe by one unsafe cell, safe if all cells are, else unknown."""
    size = 2 * reach + 1
    bad = maximum_filter(unsafe, size, mode="constant", cval=False)
    doubt = maximum_filter(~(safe | unsafe), size, mode="constant", cval=True)
    return np.where(bad, UNSAFE, np.where(doubt, UNKNOWN, SAFE)).astype(np.uint8)


def footprint_most(share: F64, reach: int) -> F64:
    """Return the greatest value of the cells of each footprint; NaN where one of them is NaN or outside."""
    known = np.where(np.isfinite(share), share, np.inf)
    most = maximum_filter(known, 2 * reach + 1, mode="constant", cval=np.inf)
    return np.where(np.isfinite(most), most, np.nan)


def values_on_task_grid(values: F64, grid: CellGrid, task: LandingTask) -> F32:
    """Return values of another grid at the centres of the task's cells; NaN outside it."""
    row, col, inside = grid.index(*task.grid.centres())
    out = np.full(task.grid.shape, np.nan, np.float32)
    out[inside] = values[row[inside], col[inside]]
    return out


def on_task_grid(state: U8, grid: CellGrid, task: LandingTask) -> U8:
    """Return states of another grid at the centres of the task's cells; unknown outside it."""
    row, col, inside = grid.index(*task.grid.centres())
    out = np.full(task.grid.shape, UNKNOWN, np.uint8)
    out[inside] = state[row[inside], col[inside]]
    return out


def without_outliers(returns: FlownReturns) -> FlownReturns:
    """Return the returns whose mean distance to their nearest neighbours is not unusual.

    Rusu et al., Towards 3D point cloud based object maps for household environments, Robotics and Autonomous
    Systems 56(11), 2008, section 4.1: dropped beyond the mean and two standard deviations of all.
    """
    if len(returns) <= NEIGHBOURS:
        return returns
    apart, _ = KDTree(returns.points_m).query(returns.points_m, k=NEIGHBOURS + 1)
    mean = np.asarray(apart)[:, 1:].mean(axis=1)
    keep = mean <= mean.mean() + DEVIATIONS * mean.std()
    return replace(
        returns,
        points_m=returns.points_m[keep],
        stamp_s=returns.stamp_s[keep],
        window=returns.window[keep],
    )
