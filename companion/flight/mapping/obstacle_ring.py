"""Kernels over the ring buffer of recent returns around the vehicle."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel

Stamps = Array1D[np.int64]


@kernel
def levelled(
    points: Array2D[np.float64],
    stamps: Stamps,
    oldest_ns: int,
    origin: Array1D[np.float64],
    axes: Array2D[np.float64],
    out: Array2D[np.float64],
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


@kernel
def heights_below(
    points: Array2D[np.float64],
    stamps: Stamps,
    oldest_ns: int,
    east: float,
    north: float,
    radius: float,
    out: Array1D[np.float64],
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
