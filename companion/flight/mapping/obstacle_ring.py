"""Kernels over the ring buffer of recent returns around the vehicle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]


@kernel("int64(float64[:, ::1], int64[::1], int64, float64[::1], float64[:, ::1], float64[:, ::1])")
def levelled(
    points: Floats, stamps: Stamps, oldest_ns: int, origin: Floats, axes: Floats, out: Floats
) -> int:
    """Write points since `oldest_ns` relative to an origin, in axes given by columns; return the count."""
    n = 0
    for i in range(len(stamps)):
        if stamps[i] >= oldest_ns:
            x, y, z = points[i, 0] - origin[0], points[i, 1] - origin[1], points[i, 2] - origin[2]
            for k in range(3):
                out[n, k] = x * axes[0, k] + y * axes[1, k] + z * axes[2, k]
            n += 1
    return n


@kernel("int64(float64[:, ::1], int64[::1], int64, float64, float64, float64, float64[::1])")
def heights_below(
    points: Floats, stamps: Stamps, oldest_ns: int, east: float, north: float, radius: float, out: Floats
) -> int:
    """Write the heights of the points since `oldest_ns` within a radius; return the count."""
    n = 0
    for i in range(len(stamps)):
        if stamps[i] >= oldest_ns:
            x, y = points[i, 0] - east, points[i, 1] - north
            if x * x + y * y < radius * radius:
                out[n] = points[i, 2]
                n += 1
    return n
