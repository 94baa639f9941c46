"""Span of the surface about the planes of footprints, as a kernel."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from sitl.compilation import kernel

F64 = NDArray[np.float64]
F1, F2 = types.float64[::1], types.Array(types.float64, 2, "A")


@kernel(types.void(F2, F1, types.int64, F2, F2, F2, F2))
def measure_span(
    z: F64, offsets_m: F64, step: int, mean: F64, gradient_x: F64, gradient_y: F64, span: F64
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
