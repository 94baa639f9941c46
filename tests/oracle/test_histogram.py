"""Histograms of heights against numpy, and the cut beyond gaps by hand."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.histogram import bins_of, ends_of, gaps_of


@pytest.mark.parametrize("seed", range(5))
def test_counts_are_those_of_numpy(seed: int) -> None:
    height = np.random.default_rng(seed).uniform(-3, 7, 200)
    low, high = float(height.min()), float(height.max())
    np.testing.assert_array_equal(bins_of(height, low, high, 17), np.histogram(height, 17)[0])


def test_the_highest_point_is_in_the_last_bin() -> None:
    np.testing.assert_array_equal(bins_of(np.array([0.0, 1.0, 2.0]), 0.0, 2.0, 2), [1, 2])


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
