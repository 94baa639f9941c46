"""Range gate: usable returns of a window."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.points.range_gate import are_usable, usable

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


@pytest.mark.parametrize("count", [0, 1, 63, 64, 65, 1000])
@pytest.mark.parametrize("sensor", [HERE, NOWHERE])
def test_a_cloud_that_is_usable_as_it_is_gives_its_heights(count: int, sensor: np.ndarray) -> None:
    points = cloud(count)
    points.setflags(write=False)
    height_m, all_of_them = are_usable(points, sensor, 100.0**2, 1000.0)
    assert all_of_them
    assert np.array_equal(height_m, points[:, 2])
    assert np.array_equal(usable(points, sensor, 100.0**2, 1000.0), points)


@pytest.mark.parametrize("bad", UNUSABLE)
@pytest.mark.parametrize("place", [0, 63, 64, 129])
def test_one_unusable_point_is_seen_wherever_it_stands_and_left_out(
    bad: tuple[float, float, float], place: int
) -> None:
    points = cloud(130)
    points[place] = bad
    assert not are_usable(points, HERE, 100.0**2, 1000.0)[1]
    left = usable(points, HERE, 100.0**2, 1000.0)
    assert np.array_equal(left, np.delete(points, place, axis=0))
