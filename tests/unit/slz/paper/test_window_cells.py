"""Sums of heights by cell, independent of the extent of a window."""

from __future__ import annotations

import math
import resource
from pathlib import Path

import numpy as np
import pytest

from slz.grid import Grid
from slz.paper.window_cells import WindowCells


@pytest.mark.parametrize(("half_m", "n"), [(3.0, 1500), (40.0, 70_000)])
def test_the_mean_height_of_each_cell_hit_is_that_of_its_returns(half_m: float, n: int) -> None:
    rng = np.random.default_rng(7)
    grid = Grid(-50.0, -50.0, 0.1, 1000, 1000)
    points = np.column_stack([rng.uniform(-half_m, half_m, (n, 2)), rng.uniform(-4.0, 9.0, n)])
    points[:200] = points[200:400] + np.array([0.0, 0.0, 0.5])  # cells with several
    points[0], points[1] = (70.0, 0.0, 1.0), (math.nan, 0.0, 1.0)  # outside, and no point
    returns = WindowCells()
    returns.read(points, np.full(3, np.nan), math.inf, grid)
    box = returns.whole
    assert box.col0 % 64 == box.col1 % 64 == 0
    assert box.union(returns.box) == box
    returns.sums()  # what was added up before is forgotten
    sums, unit_m, count_bits, used = returns.sums()
    sums = sums.reshape(box.shape)
    count = (sums & np.uint64((1 << count_bits) - 1)).astype(int)
    height_m = returns.low_m * count + (sums >> np.uint64(count_bits)) * unit_m

    at = np.floor((points[2:, :2] + 50.0) / 0.1).astype(int) - (box.col0, box.row0)
    own_count, own_m = np.zeros_like(count), np.zeros(count.shape)
    np.add.at(own_count, (at[:, 1], at[:, 0]), 1)
    np.add.at(own_m, (at[:, 1], at[:, 0]), points[2:, 2])
    assert used == n - 1
    np.testing.assert_array_equal(count, own_count)
    np.testing.assert_allclose(height_m, own_m, rtol=0, atol=1e-5)


def flat(
    first: list[list[float]],
) -> tuple[WindowCells, np.ndarray[tuple[int, ...], np.dtype[np.uint64]], float]:
    """Return what becomes of some returns, and then of many from ground that slopes."""
    rng = np.random.default_rng(3)
    xy = rng.uniform(-20.0, 20.0, (60_000, 2))
    ground = np.column_stack([xy, 0.16 * xy[:, 0]])
    returns = WindowCells()
    points = np.vstack([np.array(first).reshape(-1, 3), ground])
    returns.read(points, np.array([0.0, 0.0, 30.0]), 100.0, Grid(-20.0, -20.0, 0.1, 400, 400))
    returns.keep_heights(300, 0.9)
    sums, unit_m, _, _ = returns.sums()
    return returns, sums.copy(), unit_m


@pytest.mark.parametrize(
    "first", [[math.nan, 0.0, 99_999.0], [5000.0, 0.0, 99_999.0], [0.0, math.inf, -500.0]]
)
def test_a_first_return_that_is_dropped_changes_no_bit_however_high(first: list[float]) -> None:
    """Heights are rounded to four bytes over a level: that of 100 km would leave them steps of 8 mm."""
    (one, sums, _), (other, others, _) = flat([]), flat([first])
    assert (one.low_m, one.high_m, one.n) == (other.low_m, other.high_m, other.n)
    np.testing.assert_array_equal(sums, others)


@pytest.mark.parametrize("up_m", [99_999.0, -3000.0])
def test_a_first_return_far_from_the_heights_accepted_makes_no_others_coarse(up_m: float) -> None:
    returns, sums, unit_m = flat([[1.0, 1.0, up_m]])
    assert up_m < returns.low_m or returns.high_m < up_m
    used = returns.kept()
    box, bits = returns.whole, np.uint64(max(12, returns.n.bit_length()))
    at = np.floor((used[:, :2] + 20.0) / 0.1).astype(int) - (box.col0, box.row0)
    own_m = np.zeros(box.shape)
    np.add.at(own_m, (at[:, 1], at[:, 0]), used[:, 2] - returns.low_m)
    np.testing.assert_allclose((sums >> bits).reshape(own_m.shape) * unit_m, own_m, rtol=0, atol=1e-4)


def test_two_returns_far_apart_take_no_memory_for_the_ground_between() -> None:
    """Of a box of 400 MB of sums."""
    rng = np.random.default_rng(5)
    grid = Grid(-1500.0, -1500.0, 0.2, 15_000, 15_000)
    points = np.column_stack([rng.uniform(-30.0, 30.0, (20_000, 2)), rng.normal(0.0, 0.01, 20_000)])
    points[:2, :2] = (-700.0, -700.0), (700.0, 700.0)
    returns = WindowCells()
    returns.read(points, np.full(3, np.nan), math.inf, grid)
    before = resident_mb()
    sums, _, count_bits, used = returns.sums()
    assert sums.nbytes > 380e6
    assert used == 20_000
    assert resident_mb() - before < 60
    hit = sums[(sums != 0).nonzero()]
    assert int((hit & np.uint64((1 << count_bits) - 1)).sum()) == 20_000
    del sums
    assert resident_mb() - before < 60


def resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6
