"""Histograms of heights against slow code, and the cut beyond gaps against hand-made results."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.grid import Grid
from slz.kernels.lines.curve_fit import FIELDS, SAG, USUAL_SAG, USUAL_SAG_SD, fit_returns
from slz.kernels.points.histogram import beyond, ends_of, gaps_of, heights_within
from slz.paper.window_cells import WindowCells
from tests.oracle.source_rules import histogram_interval


def kept(height: NDArray[np.float64], bins: int = 31, threshold: float = 0.9) -> tuple[float, float]:
    points = np.column_stack([np.zeros((len(height), 2)), height])
    returns = WindowCells()
    returns.read(points, np.full(3, np.nan), 100.0, Grid.centred(0.0, 0.0, 20.0, 1.0))
    returns.keep_heights(bins, threshold)
    return returns.low_m, returns.high_m


@pytest.mark.parametrize("seed", range(8))
def test_the_heights_kept_are_those_of_slow_code(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lone = rng.uniform(-30, 40, rng.integers(0, 20))
    height = np.concatenate([rng.normal(100, 1, 500), 100 + lone, np.round(rng.normal(100, 1, 100), 1)])
    assert kept(height) == pytest.approx(histogram_interval(height, 31, 0.9), abs=1e-9)


def test_lone_heights_are_shed_from_the_emptier_end_as_long_as_enough_is_left() -> None:
    height = np.concatenate([np.linspace(0, 1, 990), [-9.0, 11.0, 11.0]])
    assert kept(height, 20) == (0.0, 1.0)
    assert kept(np.arange(200.0), 20) == (0.0, 199.0)  # each bin holds as many: none is sparse


def test_one_height_alone_is_kept() -> None:
    assert kept(np.full(7, 3.5)) == (3.5, 3.5)


@pytest.mark.parametrize(
    ("count", "most", "needed", "ends"),
    [
        ([1, 0, 0, 5, 5], 1, 2, (3, 4)),  # one point, then as many empty bins as needed
        ([1, 0, 5, 5, 5], 1, 2, (0, 4)),  # too few empty bins
        ([2, 0, 0, 5, 5], 1, 2, (0, 4)),  # too many points
        ([5, 5, 0, 0, 1], 1, 2, (0, 1)),
        ([5, 5, 0, 0, 2], 1, 2, (0, 4)),
        ([1, 0, 0, 5, 0, 0, 1], 1, 2, (3, 3)),
        ([1, 0, 1, 0, 0, 5], 2, 2, (5, 5)),  # the gap begins anew after each point
        ([0, 0, 0], 1, 2, (0, 2)),  # nothing is left: nothing is cut
    ],
)
def test_what_lies_beyond_a_gap_is_cut_where_it_is_little(
    count: list[int], most: int, needed: int, ends: tuple[int, int]
) -> None:
    assert ends_of(np.array(count), most, needed) == ends


def test_heights_within_a_gap_of_each_other_are_all_kept() -> None:
    height = np.linspace(10.0, 14.0, 50)
    assert gaps_of(height, 1.0, 0.1) == (10.0, 14.0)


@pytest.mark.parametrize(("lone", "kept"), [(-30.0, (0.0, 4.0)), (40.0, (0.0, 4.0))])
def test_a_lone_height_beyond_a_gap_is_cut_to_a_quarter_of_the_gap(
    lone: float, kept: tuple[float, float]
) -> None:
    height = np.append(np.linspace(0.0, 4.0, 99), lone)
    low, high = gaps_of(height, 1.0, 0.02)
    assert kept[0] - 0.25 < low <= kept[0]
    assert kept[1] <= high < kept[1] + 0.25 + 1e-9


def test_heights_that_many_lone_ones_share_are_kept() -> None:
    height = np.append(np.linspace(0.0, 4.0, 90), np.full(10, -30.0))
    assert gaps_of(height, 1.0, 0.05) == (-30.0, 4.0)


def test_a_height_out_of_all_reason_costs_no_memory_and_is_cut() -> None:
    height = np.append(np.linspace(0.0, 4.0, 99), 1e7)
    low, high = gaps_of(height, 1.0, 0.02)
    assert low == 0.0
    assert 4.0 <= high < 1e7 / 99_999 + 1e-6


def test_heights_of_some_points_and_those_beyond_an_interval() -> None:
    rng = np.random.default_rng(2)
    points, which = rng.normal(size=(300, 3)), rng.random(300) < 0.7
    np.testing.assert_array_equal(heights_within(points, which), points[which, 2])
    strays = np.flatnonzero(which & ((points[:, 2] < -1.0) | (points[:, 2] > 0.5)))
    np.testing.assert_array_equal(beyond(points, which, -1.0, 0.5), strays)
    assert not len(beyond(points, which, -np.inf, np.inf))


# The kernel's curve against NumPy's least squares.


@pytest.mark.parametrize("seed", range(20))
def test_the_curve_is_that_of_least_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, turn = int(rng.integers(6, 60)), rng.uniform(0, np.pi)
    way, sag = np.array([np.cos(turn), np.sin(turn)]), rng.uniform(0.001, 0.01)
    s = rng.uniform(-20, 20, n)
    sigma = rng.uniform(0.03, 0.2, n)
    aside = rng.normal(0, sigma)
    level = s[:, None] * way + aside[:, None] * [-way[1], way[0]] + rng.uniform(-900, 900, 2)
    points = np.column_stack([level, 12 + 0.05 * s + sag * s * s + rng.normal(0, sigma)])
    curve = np.empty(FIELDS)
    assert fit_returns(np.column_stack([points, sigma]), np.arange(n), curve)
    weight = sigma**-2
    place = weight @ level / weight.sum()
    _, axes = np.linalg.eigh(((level - place) * weight[:, None]).T @ (level - place))
    along = axes[:, 1] * np.sign(axes[:, 1] @ curve[2:4])
    np.testing.assert_allclose(curve[:2], place, atol=1e-6)
    np.testing.assert_allclose(curve[2:4], along, atol=1e-9)
    t = (level - place) @ along
    design = np.vstack([np.column_stack([np.ones(n), t, t * t]) / sigma[:, None], [0, 0, 1 / USUAL_SAG_SD]])
    right = np.append(points[:, 2] / sigma, USUAL_SAG / USUAL_SAG_SD)
    expected, *_ = np.linalg.lstsq(design, right, rcond=None)
    if expected[2] > 0:
        np.testing.assert_allclose(curve[4:7], expected, rtol=1e-5, atol=1e-6)
    else:
        assert curve[SAG] == 0


def test_returns_at_one_place_make_no_curve() -> None:
    curve = np.empty(FIELDS)
    assert not fit_returns(np.ones((5, 4)), np.arange(5), curve)
