"""Span of the surface about the planes of footprints, as a kernel."""

from __future__ import annotations

import numpy as np

from sitl.array_types import Array1D, Array2D, Strided2D
from sitl.compilation import kernel

Plane = Strided2D[np.float64]


@kernel
def measure_span(
    z: Array2D[np.float64],
    offsets_m: Array1D[np.float64],
    step: int,
    mean: Plane,
    gradient_x: Plane,
    gradient_y: Plane,
    room: Array2D[np.float64],
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
    room
        (3, samples of a footprint's side): the plane and the extremes along a row of samples, so that the
        compiler takes several samples at once.
    """
    n = len(offsets_m)
    plane, lowest, highest = room[0], room[1], room[2]
    for column in range(mean.shape[0]):
        for row in range(mean.shape[1]):
            for i in range(n):
                plane[i] = mean[column, row] + gradient_x[column, row] * offsets_m[i]
                lowest[i], highest[i] = np.inf, -np.inf
            for j in range(n):
                north = gradient_y[column, row] * offsets_m[j]
                samples = z[row * step + j, column * step : column * step + n]
                for i in range(n):
                    residual = samples[i] - (plane[i] + north)
                    lowest[i], highest[i] = min(lowest[i], residual), max(highest[i], residual)
            least, most = np.inf, -np.inf
            for i in range(n):
                least, most = min(least, lowest[i]), max(most, highest[i])
            span[column, row] = np.nan if np.isnan(mean[column, row]) else most - least
