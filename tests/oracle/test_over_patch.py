"""Returns over a patch of heights, and those raised over it, against NumPy's plain formulas."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.points.over_patch import find_intruders, find_raised, over_patch

Floats = NDArray[np.float64]
WEST, SOUTH, CELL, ROWS, COLS = -8.0, -5.0, 0.5, 24, 30


class Case(NamedTuple):
    """Returns and a patch."""

    points: Floats
    ground: NDArray[np.float32]
    tops: NDArray[np.float32]
    even: NDArray[np.bool_]


class Over(NamedTuple):
    """What is over the patch."""

    numbers: NDArray[np.intp]
    cells: NDArray[np.intp]
    over: Floats
    places: Floats
    voting: Floats


@pytest.fixture(params=range(4))
def case(request: pytest.FixtureRequest) -> Case:
    rng = np.random.default_rng(request.param)
    points = rng.uniform((-12, -8, -1), (12, 12, 3), (3000, 3))
    points[rng.random(3000) < 0.01] = np.nan
    points[rng.random(3000) < 0.01, 2] = np.inf
    ground, tops = (rng.normal(0, 0.3, (ROWS, COLS)).astype(np.float32) for _ in range(2))
    for layer in (ground, tops):
        layer[rng.random((ROWS, COLS)) < 0.1] = np.nan
    return Case(points, ground, tops, rng.random((ROWS, COLS)) < 0.7)


def plainly_over(case: Case, heights: NDArray[np.float32], around: tuple[float, float, float, float]) -> Over:
    index = np.flatnonzero(np.isfinite(case.points).all(axis=1))
    col = np.floor((case.points[index, 0] - WEST) / CELL)
    row = np.floor((case.points[index, 1] - SOUTH) / CELL)
    here = (row >= 0) & (row < ROWS) & (col >= 0) & (col < COLS)
    index, cells = index[here], (row[here] * COLS + col[here]).astype(np.intp)
    points = case.points[index]
    over = points[:, 2] - heights.ravel()[cells]
    away = np.hypot(points[:, 0] - around[0], points[:, 1] - around[1])
    votes = case.even.ravel()[cells] & (away > around[2]) & (away < around[3])
    voters, of_cell, count = np.unique(cells[votes], return_inverse=True, return_counts=True)
    lowest = np.full(len(voters), np.inf)
    with np.errstate(invalid="ignore"):  # NaN stays NaN
        np.minimum.at(lowest, of_cell, over[votes])
    east, north = (np.bincount(of_cell, axis, len(voters)) / count for axis in points[votes, :2].T)
    return Over(index, cells, over, points[:, :2], np.column_stack([east, north, lowest]))


def by_kernel(case: Case, heights: NDArray[np.float32], around: tuple[float, float, float, float]) -> Over:
    index, cells = np.empty((2, len(case.points)), np.int64)
    over, places, voting = (np.empty((len(case.points), *shape)) for shape in ((), (2,), (3,)))
    n, k = over_patch(
        case.points, WEST, SOUTH, CELL, heights, case.even, around, index, cells, places, over, voting
    )
    return Over(index[:n], cells[:n], over[:n], places[:n], voting[:k])


@pytest.mark.parametrize("around", [(1.0, -2.0, -1.0, 9.0), (0.3, 0.2, 2.5, math.inf)])
def test_returns_over_a_patch_and_its_votes(case: Case, around: tuple[float, float, float, float]) -> None:
    for expected, found in zip(
        plainly_over(case, case.tops, around), by_kernel(case, case.tops, around), strict=True
    ):
        assert np.array_equal(expected, found, equal_nan=True)


def test_raised_returns(case: Case) -> None:
    sensor, noise = np.array([0.5, -1.0, 9.0]), 0.004
    here = by_kernel(case, case.ground, (0.5, -1.0, -1.0, 7.0))
    shift = np.random.default_rng(9).normal(0, 0.1, len(here.numbers))
    points = case.points[here.numbers]
    over, beyond = here.over - shift, points[:, 2] - case.tops.ravel()[here.cells] - shift
    way = points - sensor
    aside, range_m = np.hypot(way[:, 0], way[:, 1]), np.linalg.norm(way, axis=1)
    raised = (beyond > np.hypot(0.25, 4.0 * noise * aside)) & (over < 2.0) & (aside < 7.0) & (range_m > 7.5)
    expected, heights = here.numbers[raised], over[raised]
    n = find_raised(
        case.points, sensor, here.numbers, here.cells, here.over, shift, case.ground, case.tops,
        0.25, 2.0, noise, 7.5, 7.0,
    )  # fmt: skip
    assert 0 < n < len(here.numbers)
    assert np.array_equal(here.numbers[:n], expected)
    assert np.array_equal(here.over[:n], heights)


@pytest.mark.parametrize("known", [True, False])
def test_returns_of_intruders(case: Case, known: bool) -> None:
    sensor, place, noise, range_noise = np.array([0.5, -1.0, 9.0]), np.array([0.4, 0.1, 0.0]), 0.004, 0.02
    if not known:
        sensor[1] = np.nan
    here = by_kernel(case, case.tops, (0.4, 0.1, 3.0, math.inf))
    shift = np.random.default_rng(9).normal(0, 0.1, len(here.numbers))
    points = case.points[here.numbers]
    way, over = points - sensor, here.over - shift
    aside = np.hypot(way[:, 0], way[:, 1]) if known else np.zeros(len(way))
    range_m = np.linalg.norm(way, axis=1) if known else np.full(len(way), np.inf)
    away = np.hypot(points[:, 0] - place[0], points[:, 1] - place[1])
    noise_m = 4.0 * np.hypot(noise * aside, range_noise)
    which = (away < 1.5) & (over > 0.3 + noise_m) | (away < 3.0) & (over > 0.8 + noise_m)
    expected = here.numbers[which], over[which], range_m[which]
    ranges = np.empty(len(here.numbers))
    n = find_intruders(
        case.points, sensor, here.numbers, here.over, shift, place, (1.5, 0.3), (3.0, 0.8),
        noise, range_noise, ranges,
    )  # fmt: skip
    assert 0 < n < len(here.numbers)
    for one, other in zip(expected, (here.numbers[:n], here.over[:n], ranges[:n]), strict=True):
        assert np.array_equal(one, other)
