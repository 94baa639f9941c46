"""Returns over a patch of heights, and those raised over it, against NumPy's plain formulas."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from companion.flight.fusion.height_datum import CELLS, SIDE, find_lowest
from slz.kernels.points.over_patch import find_intruders, find_raised, over_patch
from slz.kernels.points.prior_agreement import contradict, heights_over
from slz.kernels.survey.point_binning import BLOCK, BLOCK_BITS, count_lines, count_squares, place

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


# Points over surveyed and mapped ground, against hand-made results.


SAFE = np.array([[1, 0, 1], [1, 1, 255]], np.uint8)
HEIGHT = np.array([[10, 11, 12], [20, 21, 22]], np.float32)


@pytest.mark.parametrize(
    ("east", "north", "over"),
    [
        (100.0, 200.0, 5.0),  # the corner of the first cell
        (102.5, 200.5, np.nan),  # not safe
        (104.0, 201.9, 3.0),
        (100.5, 202.0, -5.0),
        (105.9, 203.0, np.nan),  # unknown
        (99.99, 201.0, np.nan),  # outside, on each side
        (106.0, 201.0, np.nan),
        (101.0, 199.99, np.nan),
        (101.0, 204.0, np.nan),
    ],
)
def test_heights_are_over_safe_ground_alone(east: float, north: float, over: float) -> None:
    got = heights_over(np.array([[east, north, 15.0]]), 100.0, 200.0, 2.0, SAFE, HEIGHT)
    np.testing.assert_array_equal(got, [over])


def contradicted(
    over: list[float], at: list[list[float]], angle_noise_rad: float = 0.0
) -> tuple[int, list[int]]:
    marks = np.zeros((2, 3), np.uint8)
    points = np.array([[*xy, 0.0] for xy in at])
    sensor = np.array([100.0, 200.0, 30.0])
    n = contradict(points, np.array(over), sensor, 0.5, 1.0, angle_noise_rad, 100.0, 200.0, 2.0, marks)
    return n, marks.ravel().tolist()


def test_only_what_differs_by_more_than_the_least_contradicts() -> None:
    at = [[100.5, 200.5], [102.5, 200.5], [104.5, 200.5], [100.5, 202.5]]
    assert contradicted([1.5, 1.6, -0.5, -0.6], at) == (2, [0, 1, 0, 1, 0, 0])


def test_a_cell_is_counted_once_and_a_height_that_is_not_known_never() -> None:
    at = [[100.5, 200.5], [100.6, 200.6], [102.5, 200.5]]
    assert contradicted([9.0, 9.0, np.nan], at) == (1, [1, 0, 0, 0, 0, 0])


def test_four_standard_deviations_of_the_angle_at_the_distance_are_allowed() -> None:
    at = [[103.0, 202.999], [103.0, 202.999]]  # 4.242 m away: 4 x 0.1 x 4.242 = 1.697 m
    assert contradicted([0.5 + 1.0 + 1.69, 0.5], at, 0.1)[0] == 0
    assert contradicted([0.5 + 1.0 + 1.71, 0.5], at, 0.1)[0] == 1


# Lowest returns of a scan by cells, against NumPy's plain formulas.


@pytest.mark.parametrize(("every", "reach_m"), [(1, 28.0), (3, 28.0), (2, 5.0), (1, 0.0)])
def test_lowest_returns(every: int, reach_m: float) -> None:
    rng = np.random.default_rng(every)
    sensor = np.array([-70.3, 40.2, 20.0])
    points = rng.normal((-70, 40, 0), (12, 12, 2), (4000, 3))
    some = points[::every]
    some = some[np.hypot(some[:, 0] - sensor[0], some[:, 1] - sensor[1]) < reach_m]
    cells = np.floor(some[:, :2]).astype(np.int64)
    number = cells[:, 0] % SIDE * SIDE + cells[:, 1] % SIDE
    expected = [
        (n, *cells[number == n][0].tolist(), float(some[number == n, 2].min())) for n in np.unique(number)
    ]
    index, places, heights = np.empty(CELLS, np.int64), np.empty((2, CELLS), np.int64), np.empty(CELLS)
    which = np.empty(CELLS, np.int64)
    n = find_lowest(points, every, sensor, reach_m, index, places, heights, which)
    assert list(zip(index[:n], *places[:, :n], points[which[:n], 2], strict=True)) == expected
    assert (heights[:n] == points[which[:n], 2]).all()


# Counts of a block's points by row, column and square of cells, against numpy.


RNG = np.random.default_rng(5)
ROW, COL = RNG.integers(0, BLOCK, (2, 400))
OVER_GROUND_CELL = (ROW << BLOCK_BITS | COL).astype(np.uint16)


def test_points_are_counted_by_row_and_by_column() -> None:
    rows, cols = np.ones(BLOCK, np.int64), np.zeros(BLOCK, np.int64)
    count_lines(OVER_GROUND_CELL, rows, cols)
    np.testing.assert_array_equal(rows, 1 + np.bincount(ROW, minlength=BLOCK))
    np.testing.assert_array_equal(cols, np.bincount(COL, minlength=BLOCK))


@pytest.mark.parametrize("bits", [0, 1, 3])
def test_points_are_counted_by_squares_of_cells(bits: int) -> None:
    side = BLOCK >> bits
    count = np.zeros((side, side), np.int32)
    count_squares(OVER_GROUND_CELL, count, bits)
    expected = np.zeros((side, side), np.int32)
    np.add.at(expected, (ROW >> bits, COL >> bits), 1)
    np.testing.assert_array_equal(count, expected)


def test_points_go_to_the_blocks_they_lie_in_however_often_these_take_turns() -> None:
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-2.0 * BLOCK, 2.0 * BLOCK, (2, 300))
    z = rng.uniform(-5, 5, 300)
    keep = rng.random(300) < 0.8
    blocks, slots = np.empty((32, 2), np.int64), np.full(64, -1, np.int64)
    cell, height, block = np.empty(300, np.uint16), np.empty(300, np.int32), np.empty(300, np.int32)
    mark, marked = rng.integers(0, 256, 300).astype(np.uint8), np.empty(300, np.uint8)
    n, n_blocks = place(
        x, y, z, keep, 1.0, 1.0, 100.0, 1e6, blocks, slots, 0, mark, cell, height, block, marked
    )
    np.testing.assert_array_equal(marked[:n], mark[keep])
    row, col = np.floor(y[keep]).astype(int), np.floor(x[keep]).astype(int)
    assert n == keep.sum()
    assert n_blocks == len({(r // BLOCK, c // BLOCK) for r, c in zip(row, col, strict=True)}) == 16
    np.testing.assert_array_equal(blocks[block[:n]], np.column_stack([row // BLOCK, col // BLOCK]))
    np.testing.assert_array_equal(cell[:n], (row % BLOCK << BLOCK_BITS) | (col % BLOCK))
    np.testing.assert_array_equal(height[:n], np.rint(z[keep] * 100))
