"""Span of the surface about the planes of footprints, as a kernel."""

from __future__ import annotations

import numpy as np

from sitl.array_types import Array1D, Strided2D
from sitl.compilation import kernel

Plane = Strided2D[np.float64]


@kernel
def measure_span(
    z: Plane,
    offsets_m: Array1D[np.float64],
    step: int,
    mean: Plane,
    gradient_x: Plane,
    gradient_y: Plane,
    span: Plane,
) -> None:
    """Write the greatest less the smallest residual of each footprint; NaN where its plane is NaN.

    Parameters
    ----------
    z
        (rows, columns) samples of heights, m.
    offsets_m
        Of a footprint's samples from its centre, the same in both directions.
    step
        Samples from one footprint to the next.
    mean, gradient_x, gradient_y, span
        (columns, rows) of the footprints: their planes, and the result, m.
    """
    n = len(offsets_m)
    for column in range(mean.shape[0]):
        for row in range(mean.shape[1]):
            level, east, north = mean[column, row], gradient_x[column, row], gradient_y[column, row]
            lowest, highest = np.inf, -np.inf
            for j in range(n):
                for i in range(n):
                    plane = level + east * offsets_m[i] + north * offsets_m[j]
                    residual = z[row * step + j, column * step + i] - plane
                    lowest, highest = min(lowest, residual), max(highest, residual)
            span[column, row] = np.nan if np.isnan(level) else highest - lowest
