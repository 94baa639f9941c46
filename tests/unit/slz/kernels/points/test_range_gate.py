"""Range gate: usable returns of a window are flagged, and other flags stay."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.points.range_gate import heights_and_ranges, mark_usable, within_reach
from slz.kernels.points.rows import mark, picked, rows_by_scan, rows_in_turn, rows_of

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
    points = cloud(200)
    near = ~(np.hypot(*(points[:, :2] - sensor[:2]).T) > 30.0)
    np.testing.assert_array_equal(within_reach(points, sensor, 900.0), near)


# Rows of returns by their flags, against NumPy.


@pytest.mark.parametrize(("has", "lacks"), [(0, 0), (1, 0), (0, 1), (3, 4), (8, 3)])
@pytest.mark.parametrize("n", [0, 1, 500])
def test_rows_are_those_with_all_of_one_sum_and_none_of_the_other(n: int, has: int, lacks: int) -> None:
    random = np.random.default_rng(n)
    flags, places = random.integers(0, 16, n).astype(np.uint16), random.normal(size=(n, 3))
    wanted = ((flags & has) == has) & ((flags & lacks) == 0)
    assert np.array_equal(rows_of(flags, has, lacks), np.flatnonzero(wanted))
    assert np.array_equal(picked(places, flags, has, lacks), places[wanted])


@pytest.mark.parametrize("n", [0, 1, 500])
def test_rows_by_scan_are_sorted_by_scan_and_those_of_the_last_flag_end_each(n: int) -> None:
    random = np.random.default_rng(n)
    flags, origin = random.integers(0, 16, n).astype(np.uint16), random.integers(0, 5, n).astype(np.uint16)
    wanted = [i for i in range(n) if flags[i] & (2 | 4)]
    wanted.sort(key=lambda i: (origin[i], bool(flags[i] & 4)))
    assert rows_by_scan(flags, 2, 4, origin, 5).tolist() == wanted


@pytest.mark.parametrize("n", [0, 1, 500])
def test_rows_of_one_flag_come_before_those_of_others_without_it(n: int) -> None:
    flags = np.random.default_rng(n).integers(0, 16, n).astype(np.uint16)
    first, others = (flags & 2) != 0, np.array([8, 4], np.uint16)
    wanted = [first, *(~first & ((flags & other) != 0) for other in others)]
    found = rows_in_turn(flags, 2, others)
    assert np.array_equal(found, np.concatenate([np.flatnonzero(which) for which in wanted]))


def test_a_flag_is_set_of_those_rows_alone_which_are_told() -> None:
    random = np.random.default_rng(1)
    flags, rows, which = (
        random.integers(0, 16, 90).astype(np.uint16),
        random.permutation(90)[:50],
        np.arange(50) % 3 == 0,
    )
    wanted = flags.copy()
    wanted[rows[which]] |= np.uint16(4)
    mark(flags, rows, which, 4)
    assert np.array_equal(flags, wanted)
