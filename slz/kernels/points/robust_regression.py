"""Robust regression with Tukey's biweight: normal equations, and removal of a fitted plane from points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

Reals = NDArray[np.float64]


@kernel(
    "Tuple((float64[:, ::1], float64[::1], float64))(float64[:, ::1], float64[::1], float64[::1], float64)"
)
def weighted_normal_equations(
    design: Reals, values: Reals, error: Reals, most: float
) -> tuple[Reals, Reals, float]:
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


@kernel("float64[:, ::1](float64[:, ::1], float64[::1], float64, float64, float64)")
def subtract_plane(points: Reals, sensor: Reals, up: float, east: float, north: float) -> Reals:
    """Return points (n, 3) lowered by a height, and by a slope per metre east and north of the sensor."""
    out = np.empty_like(points)
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        tilt = 0.0 if east == 0 and north == 0 else east * (x - sensor[0]) + north * (y - sensor[1])
        out[i, 0], out[i, 1], out[i, 2] = x, y, points[i, 2] - up - tilt
    return out
