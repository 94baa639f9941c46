"""Robust fits against numpy, and residual points after removal of the plane."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.points.robust_regression import robust_fit, subtract_plane
from slz.points.registration import wide_axes


def fitted(design: np.ndarray, values: np.ndarray, rounds: int) -> tuple[np.ndarray, float]:
    """The fit by NumPy: each round solves the weighted least squares of the last one's residuals."""
    fit, weights = np.zeros(design.shape[1]), np.zeros(len(values))
    fit[0] = np.sort(values)[len(values) // 2]
    for _ in range(rounds):
        error = values - design @ fit
        scale = max(0.02, 1.4826 * np.sort(np.abs(error))[len(values) // 2])
        weights = np.maximum(0, 1 - (error / (4.7 * scale)) ** 2) ** 2
        root = np.sqrt(weights)
        fit = np.linalg.lstsq(design * root[:, None], values * root, rcond=None)[0]
    return fit, float(np.count_nonzero(weights) / len(values))


@pytest.mark.parametrize("k", [1, 2, 3])
@pytest.mark.parametrize("outliers", [0.0, 0.1, 0.4])
@pytest.mark.parametrize("n", [1, 2, 60, 1001])
def test_a_robust_fit_is_that_of_reweighted_least_squares(n: int, outliers: float, k: int) -> None:
    rng = np.random.default_rng(n)
    design = np.column_stack([np.ones(n), rng.uniform(-20, 20, (n, k - 1))])
    values = design @ rng.normal(0, 0.05, k) + rng.normal(0, 0.03, n)
    values[rng.random(n) < outliers] += 1.5
    fit, agree = robust_fit(design, values, 6)
    if n >= 60:
        wanted, share = fitted(design, values, 6)
        np.testing.assert_allclose(fit, wanted, rtol=0, atol=1e-8)
        assert agree == share
    assert np.isfinite(fit).all()


@pytest.mark.parametrize("bearing_deg", [0.0, 30.0, 90.0, 135.0])
def test_the_wide_axis_of_a_strip_is_along_it(bearing_deg: float) -> None:
    rng = np.random.default_rng(5)
    along, across = rng.normal(0, 9.0, 500), rng.normal(0, 0.5, 500)
    c, s = np.cos(np.radians(bearing_deg)), np.sin(np.radians(bearing_deg))
    places = np.column_stack([100 + c * along - s * across, s * along + c * across - 40])
    (axis,) = wide_axes(places, 2.0).T
    assert abs(axis @ (c, s)) > 0.999
    np.testing.assert_array_equal(wide_axes(places, 0.3), np.eye(2))
    assert wide_axes(places, 20.0).shape == (2, 0)


def test_points_are_lowered_by_height_and_tilt_about_the_sensor() -> None:
    points, sensor = np.array([[3.0, 7.0, 10.0], [1.0, 2.0, 5.0]]), np.array([1.0, 2.0, 40.0])
    out = subtract_plane(points, sensor, 0.5, 0.1, -0.2)
    np.testing.assert_allclose(out, [[3, 7, 10 - 0.5 - 0.2 + 1.0], [1, 2, 4.5]], rtol=0, atol=1e-12)


def test_one_tilt_alone_is_a_tilt() -> None:
    points, sensor = np.array([[3.0, 7.0, 10.0]]), np.array([1.0, 2.0, 0.0])
    assert subtract_plane(points, sensor, 0.0, 0.1, 0.0)[0, 2] == 10 - 0.2
    assert subtract_plane(points, sensor, 0.0, 0.0, 0.1)[0, 2] == 10 - 0.5


def test_without_a_tilt_a_sensor_nowhere_does_no_harm() -> None:
    out = subtract_plane(np.array([[3.0, 7.0, 10.0]]), np.full(3, np.nan), 0.5, 0.0, 0.0)
    np.testing.assert_array_equal(out, [[3, 7, 9.5]])
