"""Robust regression with Tukey's biweight, and removal of a fitted plane from points."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.elementary_functions import ranked
from slz.kernels.jit import kernel, kernel_part

LEAST_SCALE, SCALE_OF_MEDIAN, BIWEIGHT = 0.02, 1.4826, 4.7  # of residuals (m); in standard deviations
RIDGE = 1e-9  # keeps the equations solvable where nothing agrees


@kernel_part
def _solve(left: Array2D[np.float64], right: Array1D[np.float64]) -> None:
    """Solve equations whose matrix is symmetric and positive, in place: the right side is the answer."""
    k = len(right)
    for i in range(k):
        for j in range(i + 1, k):
            share = left[j, i] / left[i, i]
            right[j] -= share * right[i]
            for m in range(i + 1, k):
                left[j, m] -= share * left[i, m]
    for i in range(k - 1, -1, -1):
        for j in range(i + 1, k):
            right[i] -= left[i, j] * right[j]
        right[i] /= left[i, i]


@kernel
def robust_fit(
    design: Array2D[np.float64], values: Array1D[np.float64], rounds: int
) -> tuple[Array1D[np.float64], float]:
    """Return the coefficients of a robust fit by Tukey's biweight, and the share of values that agree.

    Parameters
    ----------
    design, values
        (n, k) and (n,) of the regression, n > 0; the first column is ones.
    rounds
        Of reweighting.
    """
    n, k = design.shape
    fit, error, agree = np.zeros(k), np.empty(n), 0
    fit[0] = ranked(values.copy(), len(values) // 2)
    for _ in range(rounds):
        for i in range(n):
            error[i] = values[i]
            for a in range(k):
                error[i] -= design[i, a] * fit[a]
        most = BIWEIGHT * max(LEAST_SCALE, SCALE_OF_MEDIAN * ranked(np.abs(error), len(values) // 2))
        left, fit, agree = np.zeros((k, k)), np.zeros(k), 0
        for i in range(n):
            inner = 1 - (error[i] / most) ** 2
            if inner <= 0:
                continue
            agree += 1
            weight = inner * inner
            for a in range(k):
                share = weight * design[i, a]
                fit[a] += share * values[i]
                for b in range(k):
                    left[a, b] += share * design[i, b]
        for a in range(k):
            left[a, a] += RIDGE
        _solve(left, fit)
    return fit, agree / n


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
