"""Range gate: usable returns of a window are flagged, and other flags stay."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.points.range_gate import heights_and_ranges, mark_near, mark_usable, within_reach

HERE, NOWHERE = np.zeros(3), np.full(3, np.nan)
UNUSABLE = [
    (np.nan, 0.0, 0.0),
    (0.0, np.nan, 0.0),
    (0.0, 0.0, np.nan),
    (0.0, np.inf, 0.0),
    (0.0, 0.0, -np.inf),
    (0.0, 0.0, 1000.0),
    (0.0, 0.0, -1000.0),
    (80.0, 80.0, 0.0),
]


def cloud(count: int) -> np.ndarray:
    return np.random.default_rng(count).uniform(-50, 50, (count, 3))


def usable(points: np.ndarray, sensor: np.ndarray) -> np.ndarray:
    flags = np.full(len(points), 8, np.uint16)
    mark_usable(points, sensor, 100.0**2, 1000.0, flags, 1)
    assert (flags & ~np.uint16(1) == 8).all()
    return (flags & 1).astype(bool)


@pytest.mark.parametrize("count", [0, 1, 1000])
@pytest.mark.parametrize("sensor", [HERE, NOWHERE])
def test_near_and_finite_returns_are_usable(count: int, sensor: np.ndarray) -> None:
    assert usable(cloud(count), sensor).all()


@pytest.mark.parametrize("bad", UNUSABLE)
@pytest.mark.parametrize("place", [0, 64, 129])
def test_one_unusable_return_is_left_out_alone(bad: tuple[float, float, float], place: int) -> None:
    points = cloud(130)
    points[place] = bad
    assert np.array_equal(np.flatnonzero(~usable(points, HERE)), [place])


@pytest.mark.parametrize(("n", "every"), [(0, 1), (1, 1), (7, 3), (900, 4)])
def test_heights_and_ranges_of_a_sample(n: int, every: int) -> None:
    rng = np.random.default_rng(n)
    points, sensor = rng.normal(0, 30, (n, 3)), rng.normal(size=3)
    heights, ranges = heights_and_ranges(points, sensor, every)
    np.testing.assert_array_equal(heights, points[::every, 2])
    np.testing.assert_array_equal(ranges, np.hypot(*(points[::every, :2] - sensor[:2]).T))


@pytest.mark.parametrize("sensor", [HERE, NOWHERE])
def test_near_are_those_within_reach_over_ground(sensor: np.ndarray) -> None:
    points, flags = cloud(200), np.full(200, 2, np.uint16)
    mark_near(points, sensor, 900.0, flags, 8)
    near = ~(np.hypot(*(points[:, :2] - sensor[:2]).T) > 30.0)
    np.testing.assert_array_equal(flags, np.where(near, 10, 2))
    np.testing.assert_array_equal(within_reach(points, sensor, 900.0), near)
