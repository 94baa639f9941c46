"""Which points have company."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

FINE, COARSE = 1, 7  # layers of voxels above and below
SURFACE = 100  # returns that make a surface
ENOUGH, CLEAR_M = 5, 2.0  # so many are an object wherever dust is not dense
SPARSE = 16  # columns per point, above which a table of all columns is too large
SHORT = 12  # layers of a column that are looked at one by one
UNKNOWN = np.int32(-1)

Ints = NDArray[np.int32]
Longs = NDArray[np.int64]


@kernel("int64(int64[::1], int64, int64, int64)")
def _slot(keys: NDArray[np.int64], x: int, y: int, z: int) -> int:
    """Return where a voxel is in the table, or the empty place where it would be.

    Voxels of a column lie side by side, as they are asked for.
    """
    mask = len(keys) - 1
    key = (x << 42) | (y << 21) | z
    slot = (((x << 21) | y) * 0x5851F42D4C957F2D >> 24) + z & mask
    while keys[slot] != key and keys[slot] >= 0:
        slot = slot + 1 & mask
    return slot


@kernel("int64(int64[::1], int32[::1], int64, int64, int64, int64)")
def _within(keys: NDArray[np.int64], count: NDArray[np.int32], x: int, y: int, low: int, high: int) -> int:
    total = 0
    for a in range(x - 1, x + 2):
        for b in range(y - 1, y + 2):
            for c in range(low, high + 1):
                slot = _slot(keys, a, b, c)
                if keys[slot] >= 0:
                    total += count[slot]
    return total


@kernel("UniTuple(int64, 2)(float64[:], float64[:], float64, int64)")
def _need(
    point: NDArray[np.float64], sensor: NDArray[np.float64], share: float, least: int
) -> tuple[int, int]:
    """Return how many points a return must lie with, and how many layers up and down these are sought."""
    dx, dy, dz = point[0] - sensor[0], point[1] - sensor[1], point[2] - sensor[2]
    near = share / max(dx * dx + dy * dy + dz * dz, 1e-2)
    if near > least:  # never so where the sensor is unknown, NaN
        most = ENOUGH if dx * dx + dy * dy + dz * dz > CLEAR_M * CLEAR_M else 10_000
        return min(int(near), most), FINE
    return least, COARSE


@kernel("boolean[:](float64[:, :], int64[:, ::1], float64[:], int64, float64)")
def _by_table(
    points: NDArray[np.float64], at: Longs, sensor: NDArray[np.float64], least: int, object_m2: float
) -> NDArray[np.bool_]:
    """Do what `has_company` does with voxels in a hash table: the volume they span does not matter."""
    n = len(points)
    keep = np.ones(n, np.bool_)
    size = 64
    while size < 4 * n:
        size *= 2
    keys, count = np.full(size, -1, np.int64), np.zeros(size, np.int32)
    own = np.empty(n, np.int64)
    for i in range(n):
        slot = _slot(keys, at[i, 0], at[i, 1], at[i, 2])
        keys[slot] = (at[i, 0] << 42) | (at[i, 1] << 21) | at[i, 2]
        count[slot] += 1
        own[i] = slot
    share = object_m2 * n / (4 * np.pi)
    for i in range(n):
        x, y, z = at[i]
        need, reach = _need(points[i], sensor, share, least)
        company = int(count[own[i]])
        if company < need:
            company = level = _within(keys, count, x, y, z - FINE, z + FINE)
            if company < need and reach > FINE:
                company = _within(keys, count, x, y, z - reach, z + reach)
            if level < least and _within(keys, count, x, y, z + FINE + 1, z + COARSE) >= SURFACE:
                company = 0  # alone on its level, close below a surface
        keep[i] = company >= need
    return keep


@kernel("Tuple((int32[::1], int32[::1], int32[::1]))(int64[:, ::1], int64, int64)")
def _columns(at: Longs, columns: int, deep: int) -> tuple[Ints, Ints, Ints]:
    """Return where each column's layers begin, (columns + 1,), their heights, rising, and their counts.

    Column (x, y) is number deep * x + y.
    """
    n = len(at)
    starts = np.zeros(columns + 1, np.int32)
    for i in range(n):
        starts[deep * at[i, 0] + at[i, 1] + 1] += 1
    for k in range(columns):
        starts[k + 1] += starts[k]
    ends, heights = starts[:-1].copy(), np.empty(n, np.int32)
    for i in range(n):
        k = deep * at[i, 0] + at[i, 1]
        heights[ends[k]] = at[i, 2]
        ends[k] += 1
    layers, counts, m, first = np.empty(n, np.int32), np.empty(n, np.int32), 0, 0
    for k in range(columns):
        stop = starts[k + 1]
        if stop - first > SHORT:
            heights[first:stop] = np.sort(heights[first:stop])
        else:
            for i in range(first + 1, stop):
                z, j = heights[i], i
                while j > first and heights[j - 1] > z:
                    heights[j] = heights[j - 1]
                    j -= 1
                heights[j] = z
        starts[k], begun = m, m
        for i in range(first, stop):
            if m > begun and layers[m - 1] == heights[i]:
                counts[m - 1] += 1
            else:
                layers[m], counts[m] = heights[i], 1
                m += 1
        first = stop
    starts[columns] = m
    return starts, layers[:m].copy(), counts[:m].copy()


@kernel("int64(int32[::1], int64, int64, int64)")
def _first_from(layers: Ints, first: int, stop: int, z: int) -> int:
    """Return which of rising layers is the first not below a height."""
    while stop - first > SHORT:
        middle = (first + stop) >> 1
        if layers[middle] < z:
            first = middle + 1
        else:
            stop = middle
    while first < stop and layers[first] < z:
        first += 1
    return first


@kernel("int64(int32[::1], int32[::1], int32[::1], int64, int64, int64, int64)")
def _around(starts: Ints, layers: Ints, counts: Ints, column: int, deep: int, low: int, high: int) -> int:
    """Return how many points lie from one layer to another in 3 x 3 columns."""
    total = 0
    for middle in (column - deep, column, column + deep):
        for k in range(middle - 1, middle + 2):
            stop = starts[k + 1]
            i = _first_from(layers, starts[k], stop, low)
            while i < stop and layers[i] <= high:
                total += counts[i]
                i += 1
    return total


@kernel("boolean[:](float64[:, :], int64[:, ::1], float64[:], int64, float64, int64, int64)")
def _by_columns(
    points: NDArray[np.float64],
    at: Longs,
    sensor: NDArray[np.float64],
    least: int,
    object_m2: float,
    columns: int,
    deep: int,
) -> NDArray[np.bool_]:
    """Do what `has_company` does with the voxels of each column in a list, and once for each of them."""
    n = len(points)
    keep = np.ones(n, np.bool_)
    starts, layers, counts = _columns(at, columns, deep)
    level, wide = np.full(len(layers), UNKNOWN), np.full(len(layers), UNKNOWN)
    surface = np.full(len(layers), UNKNOWN)
    share = object_m2 * n / (4 * np.pi)
    for i in range(n):
        column, z = deep * at[i, 0] + at[i, 1], at[i, 2]
        need, reach = _need(points[i], sensor, share, least)
        v = _first_from(layers, starts[column], starts[column + 1], z)
        company = np.int64(counts[v])
        if company < need:
            if level[v] < 0:
                level[v] = _around(starts, layers, counts, column, deep, z - FINE, z + FINE)
            company = np.int64(level[v])
            if company < need and reach > FINE:
                if wide[v] < 0:
                    wide[v] = _around(starts, layers, counts, column, deep, z - COARSE, z + COARSE)
                company = np.int64(wide[v])
            if level[v] < least:
                if surface[v] < 0:
                    surface[v] = _around(starts, layers, counts, column, deep, z + FINE + 1, z + COARSE)
                if surface[v] >= SURFACE:
                    company = np.int64(0)  # alone on its level, close below a surface
        keep[i] = company >= need
    return keep


@kernel("boolean[:](float64[:, :], float64[:], float64, int64, float64)")
def has_company(
    points: NDArray[np.float64], sensor: NDArray[np.float64], voxel: float, least: int, object_m2: float
) -> NDArray[np.bool_]:
    """Tell of every point whether enough others are near it, see `slz.outliers.in_company`.

    Voxels are a quarter as high as wide.
    """
    n = len(points)
    if n == 0:
        return np.ones(0, np.bool_)
    edge = np.array([voxel, voxel, voxel / 4])
    low, most = np.empty(3), np.zeros(3, np.int64)
    for axis in range(3):
        low[axis] = edge[axis] * np.floor(points[:, axis].min() / edge[axis])  # of the map, not of the points
    at = np.empty((n, 3), np.int64)
    for i in range(n):
        for axis in range(3):
            at[i, axis] = int((points[i, axis] - low[axis]) / edge[axis]) + COARSE
            most[axis] = max(most[axis], at[i, axis])
    columns, deep = (most[0] + 2) * (most[1] + 2), most[1] + 2
    if columns > SPARSE * n + 10_000:
        return _by_table(points, at, sensor, least, object_m2)
    return _by_columns(points, at, sensor, least, object_m2, columns, deep)
