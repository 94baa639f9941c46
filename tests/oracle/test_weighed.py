"""Robust fits against numpy, and residual points after removal of the plane."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.paper.height_sums import sum_heights
from slz.kernels.paper.point_pass import DROPPED, OUTSIDE
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


# Sums of heights by cell against hand-made results, for any order of the points.


COUNT_BITS, SCALE, LEVEL, LOW, HIGH = 8, 1024.0, 50.0, 48.0, 53.0
ROW0, ROWS, COL0, COLS = 3, 70, 5, 9


def window(seed: int, n: int = 300) -> tuple[NDArray[np.float64], NDArray[np.uint32], NDArray[np.float32]]:
    rng = np.random.default_rng(seed)
    points = np.zeros((n, 3))
    points[:, 2] = rng.uniform(47.5, 53.5, n)
    points[:4, 2] = LOW, HIGH, np.nextafter(LOW, 0), np.nextafter(HIGH, 99)
    cells = ((ROW0 + rng.integers(0, ROWS, n)) << 16 | (COL0 + rng.integers(0, COLS, n))).astype(np.uint32)
    cells[10:20], cells[20:30] = DROPPED, OUTSIDE
    return points, cells, (points[:, 2] - LEVEL).astype(np.float32)


def by_hand(points: NDArray[np.float64], cells: NDArray[np.uint32]) -> tuple[int, NDArray[np.uint64]]:
    used, sums = 0, [0] * (ROWS * COLS)
    for z, cell in zip(points[:, 2], cells.tolist(), strict=True):
        if cell == DROPPED or not LOW <= z <= HIGH:
            continue
        used += 1
        if cell != OUTSIDE:
            over = int((float(np.float32(z - LEVEL)) + LEVEL - LOW) * SCALE + 0.5)
            sums[((cell >> 16) - ROW0) * COLS + (cell & 0xFFFF) - COL0] += (over << COUNT_BITS) + 1
    return used, np.array(sums, np.uint64)


@pytest.mark.parametrize("n", [30, 64, 300, 1000])
@pytest.mark.parametrize("seed", range(4))
def test_sums_and_counts_are_those_by_hand_in_any_order(seed: int, n: int) -> None:
    points, cells, heights = window(seed, n)
    used, expected = by_hand(points, cells)
    mixed = np.random.default_rng(seed).permutation(n)
    found = []
    for order in (np.arange(n), np.argsort(cells, kind="stable"), mixed):
        flat, sums = points[order].ravel(), np.zeros(ROWS * COLS, np.uint64)
        flat.flags.writeable = False
        limits = LEVEL, LOW, HIGH, SCALE, COUNT_BITS, ROW0, COL0, COLS
        assert sum_heights(flat, cells[order], heights[order], *limits, sums) == used
        found.append(sums)
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])
    np.testing.assert_array_equal(found[0] & np.uint64(255), expected & np.uint64(255))
    heights_of = (found[0] >> np.uint64(8)).astype(np.int64) - (expected >> np.uint64(8)).astype(np.int64)
    assert abs(heights_of).max() <= 1  # of 1 / 1024 m: at the ends the height is taken in full precision
