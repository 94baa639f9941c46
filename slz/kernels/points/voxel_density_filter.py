"""Density-based outlier removal on a voxel grid."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D, ReadOnly2D, Strided1D
from slz.kernels.jit import kernel, kernel_part

FINE = 1  # layers of voxels above and below that are searched
EDGE = 2  # empty voxels around all points
OBJECT_RETURNS, CLEAR_M = 5, 2.0  # returns that are an object; range up to which dense dust demands more
SHARE = 10  # one return in so many of its column, up to `OBJECT_RETURNS`, is a surface
TALL = 20  # layers of a column above and below
DENSE_PER_POINT = 16  # voxel columns, or their layers, per point, above which a dense table is too large
NO_LAYER = np.int32(2**31 - 1)

Longs = Array1D[np.int64]


@kernel_part
def _hash_slot(keys: Array1D[np.int64], x: int, y: int, z: int) -> int:
    """Return the hash slot of a voxel, or the empty slot for it.

    Voxels of a column are in adjacent slots, because they are read together.
    """
    mask = len(keys) - 1
    key = (x << 42) | (y << 21) | z
    slot = (((x << 21) | y) * 0x5851F42D4C957F2D >> 24) + z & mask
    while keys[slot] != key and keys[slot] >= 0:
        slot = slot + 1 & mask
    return slot


@kernel_part
def _count_around(
    keys: Array1D[np.int64], count: Array1D[np.int32], x: int, y: int, low: int, high: int
) -> int:
    total = 0
    for a in range(x - 1, x + 2):
        for b in range(y - 1, y + 2):
            for c in range(low, high + 1):
                slot = _hash_slot(keys, a, b, c)
                if keys[slot] >= 0:
                    total += count[slot]
    return total


@kernel_part
def _support_needed(
    point: ReadOnly1D[np.float64], sensor: Strided1D[np.float64], share: float, least: int
) -> int:
    """Return how many points a return needs around it for the pulses that an object there would return."""
    dx, dy, dz = point[0] - sensor[0], point[1] - sensor[1], point[2] - sensor[2]
    near = share / max(dx * dx + dy * dy + dz * dz, 1e-2)
    if near > least:  # False where the sensor is unknown, NaN
        most = OBJECT_RETURNS if dx * dx + dy * dy + dz * dz > CLEAR_M * CLEAR_M else 10_000
        return min(int(near), most)
    return least


@kernel_part
def _by_table(
    points: ReadOnly2D[np.float64],
    at: Array2D[np.int32],
    sensor: Strided1D[np.float64],
    least: int,
    object_m2: float,
) -> Strided1D[np.bool_]:
    """Compute `is_supported` with voxels in a hash table, whose size is independent of the volume spanned."""
    n = len(points)
    keep = np.ones(n, np.bool_)
    size = 64
    while size < 4 * n:
        size *= 2
    keys, count = np.full(size, -1, np.int64), np.zeros(size, np.int32)
    own = np.empty(n, np.int64)
    for i in range(n):
        x, y, z = int(at[i, 0]), int(at[i, 1]), int(at[i, 2])
        slot = _hash_slot(keys, x, y, z)
        keys[slot] = (x << 42) | (y << 21) | z
        count[slot] += 1
        own[i] = slot
    share = object_m2 * n / (4 * np.pi)
    for i in range(n):
        x, y, z = int(at[i, 0]), int(at[i, 1]), int(at[i, 2])
        need = _support_needed(points[i], sensor, share, least)
        if count[own[i]] >= max(need, OBJECT_RETURNS):
            continue
        level = _count_around(keys, count, x, y, z - FINE, z + FINE)
        if need <= level < OBJECT_RETURNS:
            column = _count_around(keys, count, x, y, z - TALL, z + TALL)
            need = max(need, min(OBJECT_RETURNS, column // SHARE))
        keep[i] = level >= need
    return keep


@kernel_part
def _column_spans(at: Array2D[np.int32], columns: int, deep: int) -> tuple[Longs, Array2D[np.int32]]:
    """Return (columns + 1,) the start of each column's layers, and (columns, 2) its lowest and highest layer.

    Column (x, y) has the number deep * x + y. A column holds all layers between these two, an empty one none.
    """
    ends = np.empty((columns, 2), np.int32)
    ends[:, 0], ends[:, 1] = NO_LAYER, -1
    for i in range(len(at)):
        k, z = deep * at[i, 0] + at[i, 1], at[i, 2]
        ends[k, 0], ends[k, 1] = min(ends[k, 0], z), max(ends[k, 1], z)
    starts = np.empty(columns + 1, np.int64)
    total = 0
    for k in range(columns):
        starts[k] = total
        total += max(0, ends[k, 1] - ends[k, 0] + 1)
    starts[columns] = total
    return starts, ends


@kernel_part
def _count_in_columns(
    starts: Longs,
    ends: Array2D[np.int32],
    below: Array1D[np.int32],
    column: int,
    deep: int,
    low: int,
    high: int,
    enough: int,
) -> int:
    """Return the number of points in layers low to high of 3 x 3 columns; counting stops at `enough`."""
    total = 0
    for middle in (column, column - deep, column + deep):
        for k in (middle, middle - 1, middle + 1):
            bottom, top = max(low, ends[k, 0]), min(high, ends[k, 1])
            if bottom <= top:
                first = starts[k] - ends[k, 0]
                total += int(below[first + top + 1] - below[first + bottom])
                if total >= enough:
                    return total
    return total


@kernel_part
def _by_columns(
    points: ReadOnly2D[np.float64],
    at: Array2D[np.int32],
    sensor: Strided1D[np.float64],
    least: int,
    object_m2: float,
    deep: int,
    starts: Longs,
    ends: Array2D[np.int32],
) -> Strided1D[np.bool_]:
    """Compute `is_supported` with all layers of each column stored contiguously."""
    n = len(points)
    keep, own = np.ones(n, np.bool_), np.empty(n, np.int32)
    counts, below = np.zeros(starts[-1], np.int32), np.zeros(starts[-1] + 1, np.int32)
    for i in range(n):
        column = deep * at[i, 0] + at[i, 1]
        own[i] = starts[column] - ends[column, 0] + at[i, 2]
        counts[own[i]] += 1
    for v in range(len(counts)):
        below[v + 1] = below[v] + counts[v]
    share = object_m2 * n / (4 * np.pi)
    for i in range(n):
        need = _support_needed(points[i], sensor, share, least)
        if counts[own[i]] >= max(need, OBJECT_RETURNS):
            continue
        column, z = deep * at[i, 0] + at[i, 1], int(at[i, 2])
        most = max(need, OBJECT_RETURNS)
        level = _count_in_columns(starts, ends, below, column, deep, z - FINE, z + FINE, most)
        if need <= level < OBJECT_RETURNS:
            enough = SHARE * OBJECT_RETURNS
            whole = _count_in_columns(starts, ends, below, column, deep, z - TALL, z + TALL, enough)
            need = max(need, min(OBJECT_RETURNS, whole // SHARE))
        keep[i] = level >= need
    return keep


@kernel_part
def _voxels_of(points: ReadOnly2D[np.float64], voxel: float) -> tuple[Array2D[np.int32], int, int]:
    """Return (n, 3) the voxel of each point, indices from `EDGE` on, and the greatest x and y index.

    The voxel lattice is fixed to the map, not to the points.
    """
    high = voxel / 4
    west = south = bottom = np.inf
    for i in range(len(points)):
        west, south = min(west, points[i, 0]), min(south, points[i, 1])
        bottom = min(bottom, points[i, 2])
    west, south = voxel * np.floor(west / voxel), voxel * np.floor(south / voxel)
    bottom = high * np.floor(bottom / high)
    at = np.empty((len(points), 3), np.int32)
    most_x, most_y = 0, 0
    for i in range(len(points)):
        x = int((points[i, 0] - west) / voxel) + EDGE
        y = int((points[i, 1] - south) / voxel) + EDGE
        at[i, 0], at[i, 1], at[i, 2] = x, y, int((points[i, 2] - bottom) / high) + EDGE
        most_x, most_y = max(most_x, x), max(most_y, y)
    return at, most_x, most_y


@kernel
def is_supported(
    points: ReadOnly2D[np.float64], sensor: Strided1D[np.float64], voxel: float, least: int, object_m2: float
) -> Strided1D[np.bool_]:
    """Return which points have enough others near them, see `slz.points.outliers.not_isolated`.

    Voxels are a quarter as high as wide.
    """
    n = len(points)
    if n == 0:
        return np.ones(0, np.bool_)
    at, most_x, most_y = _voxels_of(points, voxel)
    columns, deep = (most_x + 2) * (most_y + 2), most_y + 2
    if columns <= DENSE_PER_POINT * n + 10_000:
        starts, ends = _column_spans(at, columns, deep)
        if starts[columns] <= DENSE_PER_POINT * n + 10_000:
            return _by_columns(points, at, sensor, least, object_m2, deep, starts, ends)
    return _by_table(points, at, sensor, least, object_m2)
