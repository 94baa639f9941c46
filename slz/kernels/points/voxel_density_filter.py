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
FIRST, LOWEST, ABOVE = range(3)  # of a column
CHUNK = 192  # coordinates worked on together, a multiple of three


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
def _columns_of(at: Array2D[np.int32], columns: int, deep: int) -> tuple[Array2D[np.int32], int]:
    """Return (columns, 3) what a column holds, and the number of all layers held.

    Column (x, y) has the number deep * x + y. It holds all layers between its lowest and highest, an empty
    one none: where its layers are, less the lowest; the lowest; and the one above the highest.
    """
    out, total = np.empty((columns, 3), np.int32), 0
    for k in range(columns):
        out[k, LOWEST], out[k, ABOVE] = NO_LAYER, 0
    for i in range(len(at)):
        k, z = deep * at[i, 0] + at[i, 1], at[i, 2]
        out[k, LOWEST], out[k, ABOVE] = min(out[k, LOWEST], z), max(out[k, ABOVE], z + 1)
    for k in range(columns):
        out[k, LOWEST] = min(out[k, LOWEST], out[k, ABOVE])
        out[k, FIRST] = total - out[k, LOWEST]
        total += out[k, ABOVE] - out[k, LOWEST]
    return out, total


@kernel_part
def _count_in_column(held: Array2D[np.int32], below: Array1D[np.int32], k: int, low: int, above: int) -> int:
    """Return the number of points in layers of a column, from `low` to below `above`; without a branch."""
    first, lowest, end = held[k, FIRST], held[k, LOWEST], held[k, ABOVE]
    return int(below[first + min(max(above, lowest), end)] - below[first + min(max(low, lowest), end)])


@kernel_part
def _count_in_columns(
    held: Array2D[np.int32], below: Array1D[np.int32], k: int, deep: int, low: int, above: int, enough: int
) -> int:
    """Return the number of points in layers of 3 x 3 columns; no more are counted from `enough` on."""
    total = _count_in_column(held, below, k, low, above)
    total += _count_in_column(held, below, k - 1, low, above)
    total += _count_in_column(held, below, k + 1, low, above)
    if total < enough:
        for beside in (k - deep, k + deep):
            for one in range(beside - 1, beside + 2):
                total += _count_in_column(held, below, one, low, above)
    return total


@kernel_part
def _by_columns(
    points: ReadOnly2D[np.float64],
    at: Array2D[np.int32],
    sensor: Strided1D[np.float64],
    least: int,
    object_m2: float,
    deep: int,
    held: Array2D[np.int32],
    layers: int,
) -> Strided1D[np.bool_]:
    """Compute `is_supported` with all layers of each column stored contiguously."""
    n = len(points)
    keep, own = np.ones(n, np.bool_), np.empty(n, np.int32)
    counts, below = np.zeros(layers, np.int32), np.zeros(layers + 1, np.int32)
    for i in range(n):
        own[i] = held[deep * at[i, 0] + at[i, 1], FIRST] + at[i, 2]
        counts[own[i]] += 1
    for v in range(layers):
        below[v + 1] = below[v] + counts[v]
    share = object_m2 * n / (4 * np.pi)
    for i in range(n):
        need = _support_needed(points[i], sensor, share, least)
        most = max(need, OBJECT_RETURNS)
        if counts[own[i]] >= most:
            continue
        column, z = deep * at[i, 0] + at[i, 1], int(at[i, 2])
        level = _count_in_columns(held, below, column, deep, z - FINE, z + FINE + 1, most)
        if need <= level < OBJECT_RETURNS:
            enough = SHARE * OBJECT_RETURNS
            whole = _count_in_columns(held, below, column, deep, z - TALL, z + TALL + 1, enough)
            need = max(need, min(OBJECT_RETURNS, whole // SHARE))
        keep[i] = level >= need
    return keep


@kernel_part
def _voxels_of(points: ReadOnly2D[np.float64], voxel: float) -> tuple[Array2D[np.int32], int, int]:
    """Return (n, 3) the voxel of each point, indices from `EDGE` on, and the greatest x and y index.

    The voxel lattice is fixed to the map, not to the points. Coordinates are worked on as they are stored,
    `CHUNK` at a time, whose axes repeat: vectorised.
    """
    flat, at = points.ravel(), np.empty((len(points), 3), np.int32)
    into, low, most, size = at.ravel(), np.empty(CHUNK), np.empty(CHUNK), np.empty(CHUNK)
    for k in range(CHUNK):
        low[k] = most[k] = flat[k % 3]
        size[k] = voxel / 4 if k % 3 == 2 else voxel
    whole = len(flat) // CHUNK * CHUNK
    for start in range(0, whole, CHUNK):
        first = np.uint64(start)
        for k in range(np.uint64(CHUNK)):
            value = flat[first + k]
            low[k] = value if value < low[k] else low[k]
            most[k] = value if value > most[k] else most[k]
    for i in range(whole, len(flat)):
        low[i % 3], most[i % 3] = min(low[i % 3], flat[i]), max(most[i % 3], flat[i])
    for axis in range(3):
        low[axis::3] = size[axis] * np.floor(low[axis::3].min() / size[axis])
    for start in range(0, whole, CHUNK):
        first = np.uint64(start)
        for k in range(np.uint64(CHUNK)):
            into[first + k] = np.int32((flat[first + k] - low[k]) / size[k]) + np.int32(EDGE)
    for i in range(whole, len(flat)):
        into[i] = np.int32((flat[i] - low[i % 3]) / size[i % 3]) + np.int32(EDGE)
    x, y = int((most[::3].max() - low[0]) / voxel), int((most[1::3].max() - low[1]) / voxel)
    return at, x + EDGE, y + EDGE


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
        held, layers = _columns_of(at, columns, deep)
        if layers <= DENSE_PER_POINT * n + 10_000:
            return _by_columns(points, at, sensor, least, object_m2, deep, held, layers)
    return _by_table(points, at, sensor, least, object_m2)
