"""Robust regression with Tukey's biweight: normal equations, and removal of a fitted plane from points."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel


@kernel
def weighted_normal_equations(
    design: Array2D[np.float64], values: Array1D[np.float64], error: Array1D[np.float64], most: float
) -> tuple[Array2D[np.float64], Array1D[np.float64], float]:
    """Return the normal equations (matrix, right side) with Tukey's weights, and the share of weights over 0.

    Parameters
    ----------
    design, values, error
        (n, k) and (n,) of the regression, and (n,) residuals of the last fit.
    most
        Residual from which on the weight is 0.
    """
    n, k = design.shape
    left, right, agree = np.zeros((k, k)), np.zeros(k), 0
    for i in range(n):
        inner = 1 - (error[i] / most) ** 2
        if inner <= 0:
            continue
        agree += 1
        weight = inner * inner
        for a in range(k):
            share = weight * design[i, a]
            right[a] += share * values[i]
            for b in range(k):
                left[a, b] += share * design[i, b]
    return left, right, agree / n


@kernel
def subtract_plane(
    points: Array2D[np.float64], sensor: Array1D[np.float64], up: float, east: float, north: float
) -> Array2D[np.float64]:
    """Return points (n, 3) lowered by a height, and by a slope per metre east and north of the sensor."""
    out = np.empty_like(points)
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        tilt = 0.0 if east == 0 and north == 0 else east * (x - sensor[0]) + north * (y - sensor[1])
        out[i, 0], out[i, 1], out[i, 2] = x, y, points[i, 2] - up - tilt
    return out
