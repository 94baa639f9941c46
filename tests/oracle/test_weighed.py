"""Robust normal equations against numpy, and residual points after removal of the plane."""

from __future__ import annotations

import numpy as np

from slz.kernels.points.robust_regression import subtract_plane, weighted_normal_equations


def test_normal_equations_are_those_of_weights_by_tukey() -> None:
    rng = np.random.default_rng(3)
    design, values, error = rng.normal(size=(40, 3)), rng.normal(size=40), rng.uniform(-2, 2, 40)
    weights = np.maximum(0, 1 - (error / 1.5) ** 2) ** 2
    left, right, agree = weighted_normal_equations(design, values, error, 1.5)
    np.testing.assert_allclose(left, design.T @ np.diag(weights) @ design, rtol=1e-12)
    np.testing.assert_allclose(right, design.T @ (weights * values), rtol=1e-12)
    assert agree == np.count_nonzero(weights) / 40


def test_an_error_as_large_as_the_most_counts_for_nothing() -> None:
    left, right, agree = weighted_normal_equations(
        np.ones((2, 1)), np.array([3.0, 50.0]), np.array([0.0, -1.5]), 1.5
    )
    assert (left[0, 0], right[0], agree) == (1.0, 3.0, 0.5)


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
