"""Kernels of the surfel map: insertion of points into hashed voxels, and the plane through each."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D, ReadOnly2D
from slz.kernels.jit import kernel, kernel_part

SLOT_BITS = 17
SLOTS = 1 << SLOT_BITS
FEWEST = 8  # points that make a plane
FLAT_M = 0.035  # greatest standard deviation of the points across it
WIDE = 0.12  # least second standard deviation of its points, in sizes of the voxel
_MASK, _SHIFT = np.int64(SLOTS - 1), np.uint64(64 - SLOT_BITS)
_FACTOR = np.uint64(0x9E3779B97F4A7C15)
_COORDINATE = np.int64(0x1FFFFF)
# Columns of `sums` and `planes`.
MOMENTS, PLANE = 9, 5
ROUGHNESS = 4


@kernel_part
def key_of(x: int, y: int, z: int) -> int:
    """Return the key of a voxel, never 0."""
    return (((x & _COORDINATE) << 42) | ((y & _COORDINATE) << 21) | (z & _COORDINATE)) + 1  # type: ignore[return-value]


@kernel
def slot_of(keys: Array1D[np.int64], key: int) -> int:
    """Return the slot of a key, or the free one where it belongs."""
    i = np.int64((np.uint64(key) * _FACTOR) >> _SHIFT)
    while keys[i] != key and keys[i] != 0:
        i = (i + 1) & _MASK
    return i  # type: ignore[return-value]


@kernel_part
def fit(sums: Array1D[np.float32], count: int, size_m: float, plane: Array1D[np.float32]) -> None:
    """Write the plane of a voxel: normal (3), offset from the voxel's middle along it, roughness or -1."""
    mx, my, mz = sums[0] / count, sums[1] / count, sums[2] / count
    a, b, c = sums[3] / count - mx * mx, sums[6] / count - my * my, sums[8] / count - mz * mz
    d, e, f = sums[4] / count - mx * my, sums[5] / count - mx * mz, sums[7] / count - my * mz
    mean = (a + b + c) / 3
    spread = math.sqrt(
        ((a - mean) ** 2 + (b - mean) ** 2 + (c - mean) ** 2 + 2 * (d * d + e * e + f * f)) / 6
    )
    plane[ROUGHNESS] = -1.0
    if spread <= 1e-9:
        return
    p, q, r = (a - mean) / spread, (b - mean) / spread, (c - mean) / spread
    u, v, w = d / spread, e / spread, f / spread
    half = (p * (q * r - w * w) - u * (u * r - w * v) + v * (u * w - q * v)) / 2
    angle = math.acos(min(max(half, -1.0), 1.0)) / 3
    most = mean + 2 * spread * math.cos(angle)
    least = mean + 2 * spread * math.cos(angle + 2 * math.pi / 3)
    middle = 3 * mean - most - least
    if least > FLAT_M * FLAT_M or middle < (WIDE * size_m) ** 2:
        return
    a, b, c = a - least, b - least, c - least
    # The normal is across the rows of the rest, the best of their three products.
    x, y, z = d * f - e * b, e * d - a * f, a * b - d * d
    best = x * x + y * y + z * z
    x2, y2, z2 = d * c - e * f, e * e - a * c, a * f - d * e
    if x2 * x2 + y2 * y2 + z2 * z2 > best:
        x, y, z, best = x2, y2, z2, x2 * x2 + y2 * y2 + z2 * z2
    x2, y2, z2 = b * c - f * f, f * e - d * c, d * f - b * e
    if x2 * x2 + y2 * y2 + z2 * z2 > best:
        x, y, z, best = x2, y2, z2, x2 * x2 + y2 * y2 + z2 * z2
    if best <= 0.0:
        return
    scale = 1 / math.sqrt(best)
    if z < 0.0:
        scale = -scale
    x, y, z = x * scale, y * scale, z * scale
    plane[0], plane[1], plane[2] = x, y, z
    plane[3] = x * mx + y * my + z * mz
    plane[ROUGHNESS] = math.sqrt(max(least, 0.0))


@kernel
def insert(
    points_m: ReadOnly2D[np.float64],
    known: ReadOnly1D[np.bool_],
    stamp_ns: int,
    size_m: float,
    keys: Array1D[np.int64],
    first_ns: Array1D[np.int64],
    counts: Array1D[np.int32],
    sums: Array2D[np.float32],
    planes: Array2D[np.float32],
    hold_ns: int,
    most: int,
) -> int:
    """Add points (n, 3) that are not `known` to the voxels of one size; return the voxels begun.

    A voxel takes points for `hold_ns` from its first, and at most `most` of them: it stays where the vehicle
    first saw it.
    """
    begun = 0
    for i in range(len(points_m)):
        if known[i]:
            continue
        x, y, z = points_m[i, 0] / size_m, points_m[i, 1] / size_m, points_m[i, 2] / size_m
        ix, iy, iz = math.floor(x), math.floor(y), math.floor(z)
        key = key_of(ix, iy, iz)
        j = slot_of(keys, key)
        if keys[j] == 0:
            keys[j], first_ns[j], counts[j] = key, stamp_ns, 0
            sums[j, :] = 0.0
            planes[j, ROUGHNESS] = -1.0
            begun += 1
        elif stamp_ns - first_ns[j] > hold_ns or counts[j] >= most:
            continue
        a, b, c = (x - ix - 0.5) * size_m, (y - iy - 0.5) * size_m, (z - iz - 0.5) * size_m
        counts[j] += 1
        sums[j, 0] += a
        sums[j, 1] += b
        sums[j, 2] += c
        sums[j, 3] += a * a
        sums[j, 4] += a * b
        sums[j, 5] += a * c
        sums[j, 6] += b * b
        sums[j, 7] += b * c
        sums[j, 8] += c * c
        n = counts[j]
        if n >= FEWEST and ((n < 64 and n % 4 == 0) or n % 32 == 0):
            fit(sums[j], n, size_m, planes[j])
    return begun
