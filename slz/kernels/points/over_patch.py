"""Returns over a patch of the map's heights, and which of them are raised over it."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D, ReadOnly2D
from slz.kernels.jit import kernel

SIGMAS = 4.0  # of a height at the end of a ray, that noise explains
PLACE_EAST, PLACE_NORTH, LOWEST = range(3)  # of a voting cell


@kernel
def over_patch(
    points: ReadOnly2D[np.float64],
    west_m: float,
    south_m: float,
    cell_m: float,
    heights: ReadOnly2D[np.float32],
    even: ReadOnly2D[np.bool_],
    around: tuple[float, float, float, float],
    index: Array1D[np.int64],
    cells: Array1D[np.int64],
    places: Array2D[np.float64],
    over: Array1D[np.float64],
    voting: Array2D[np.float64],
) -> tuple[int, int]:
    """Find the returns over a patch and the lowest of each cell that votes on a shift of all heights.

    Parameters
    ----------
    points
        (n, 3) returns.
    west_m, south_m, cell_m
        Corner of the patch, and size of its cells.
    heights, even
        (rows, cols) heights to compare with, and cells that may vote.
    around
        East and north of a place, and the distances from it between which returns vote.
    index, cells, places, over
        (n,), (n,), (n, 2) and (n,), filled from the front: numbers of the returns over the patch, their
        cells, places, and heights over those of the cells.
    voting
        (n, 3), filled from the front, by cell: mean place of its returns that vote, and the least height.

    Returns
    -------
    tuple of int
        Returns over the patch, and cells that vote.
    """
    rows, cols = heights.shape
    east_m, north_m, from_m, to_m = around
    votes, sums = np.zeros(rows * cols, np.int32), np.zeros((rows * cols, 3))
    n = 0
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
            continue
        col, row = np.floor((x - west_m) / cell_m), np.floor((y - south_m) / cell_m)
        if not (0 <= row < rows and 0 <= col < cols):
            continue
        cell = int(row) * cols + int(col)
        index[n], cells[n], places[n, 0], places[n, 1] = i, cell, x, y
        over[n] = height = z - heights[int(row), int(col)]
        n += 1
        if even[int(row), int(col)] and from_m < math.hypot(x - east_m, y - north_m) < to_m:
            own = sums[cell]
            own[PLACE_EAST] += x
            own[PLACE_NORTH] += y
            if votes[cell] == 0 or height < own[LOWEST] or math.isnan(height):
                own[LOWEST] = height
            votes[cell] += 1
    k = 0
    for cell in range(rows * cols):
        if votes[cell]:
            voting[k, PLACE_EAST] = sums[cell, PLACE_EAST] / votes[cell]
            voting[k, PLACE_NORTH] = sums[cell, PLACE_NORTH] / votes[cell]
            voting[k, LOWEST] = sums[cell, LOWEST]
            k += 1
    return n, k


@kernel
def find_raised(
    points: ReadOnly2D[np.float64],
    sensor: ReadOnly1D[np.float64],
    index: Array1D[np.int64],
    cells: Array1D[np.int64],
    over: Array1D[np.float64],
    shift: Array1D[np.float64],
    ground: ReadOnly2D[np.float32],
    tops: ReadOnly2D[np.float32],
    least_m: float,
    most_m: float,
    angle_noise: float,
    near_m: float,
    far_m: float,
) -> int:
    """Keep, at the front of `index` and `over`, the returns that are raised; return how many.

    A return is raised if it is higher over the top of its cell than `least_m` and noise, and over the ground
    less than `most_m`. `shift` is taken off both; `angle_noise` is the deviation of a height per metre aside.
    """
    cols = ground.shape[1]
    kept = 0
    for k in range(len(index)):
        i, row, col = index[k], cells[k] // cols, cells[k] % cols
        x, y, z = points[i, 0] - sensor[0], points[i, 1] - sensor[1], points[i, 2] - sensor[2]
        aside = math.hypot(x, y)
        height, beyond = over[k] - shift[k], points[i, 2] - tops[row, col] - shift[k]
        if not (beyond > math.hypot(least_m, SIGMAS * angle_noise * aside) and height < most_m):  # NaN too
            continue
        if aside < far_m and math.sqrt(x * x + y * y + z * z) > near_m:
            index[kept], over[kept] = i, height
            kept += 1
    return kept


@kernel
def find_intruders(
    points: ReadOnly2D[np.float64],
    sensor: ReadOnly1D[np.float64],
    index: Array1D[np.int64],
    over: Array1D[np.float64],
    shift: Array1D[np.float64],
    place: ReadOnly1D[np.float64],
    footprint: tuple[float, float],
    disc: tuple[float, float],
    angle_noise: float,
    range_noise_m: float,
    ranges: Array1D[np.float64],
) -> int:
    """Keep, at the front of `index`, `over` and `ranges`, the returns of intruders; return how many.

    One is higher over the map, less `shift` and noise, than the second of `footprint` or `disc`, and nearer
    to the place than its first. `angle_noise`, `range_noise_m`: deviations of a height per metre aside, and
    of all heights. Where the sensor's place is unknown, all are straight below and as far as can be.
    """
    known = math.isfinite(sensor[0]) and math.isfinite(sensor[1]) and math.isfinite(sensor[2])
    kept = 0
    for k in range(len(index)):
        i = index[k]
        aside, range_m = 0.0, np.inf
        if known:
            x, y, z = points[i, 0] - sensor[0], points[i, 1] - sensor[1], points[i, 2] - sensor[2]
            aside, range_m = math.hypot(x, y), math.sqrt(x * x + y * y + z * z)
        away = math.hypot(points[i, 0] - place[0], points[i, 1] - place[1])
        height, noise_m = over[k] - shift[k], math.hypot(angle_noise * aside, range_noise_m)
        low = away < footprint[0] and height > footprint[1] + SIGMAS * noise_m  # False for NaN
        if low or (away < disc[0] and height > disc[1] + SIGMAS * noise_m):
            index[kept], over[kept], ranges[kept] = i, height, range_m
            kept += 1
    return kept
