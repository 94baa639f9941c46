"""DEM fusion of radar samples and observations, against hand-made results and a plain search."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from slz.kernels.instruments.dem_fusion import DEM_SUMS, add_samples, fuse_cells


def added(points: list[list[float]], sigma: list[float], turn: list[float], azimuth: float) -> np.ndarray:
    sums = np.zeros((3, 4, DEM_SUMS))
    ahead = np.array([1.0, 0.0])
    add_samples(np.array(points), np.array(sigma), np.array(turn), ahead, azimuth, 100.0, 200.0, 2.0, sums)
    return sums


def test_a_sample_adds_itself_once_for_each_third_of_its_beam() -> None:
    sums = added([[103.0, 205.0, 7.0]], [0.5], [3.0], 1.2)  # 0.4 m to either side: one cell
    expected = np.zeros((3, 4, DEM_SUMS))
    expected[2, 1] = 3 * np.array([4.0, 28.0, 196.0, 1.0, 12.0])
    np.testing.assert_allclose(sums, expected, rtol=1e-12)


def test_a_long_beam_lies_along_the_track_and_what_lies_outside_is_dropped() -> None:
    sums = added([[107.0, 205.0, 7.0]], [1.0], [3.0], 6.0)  # 105, 107 and 109 m: the last one is outside
    assert np.argwhere(sums[:, :, 0] > 0).tolist() == [[2, 2], [2, 3]]
    assert (sums[2, 2:, 0] == 1.0).all()


@pytest.mark.parametrize(("east", "north"), [(99.9, 203.0), (108.1, 203.0), (103.0, 199.9), (103.0, 206.1)])
def test_a_sample_outside_adds_nothing(east: float, north: float) -> None:
    assert not added([[east, north, 7.0]], [1.0], [3.0], 0.0).any()


TURNS_M = [10.0, 13.0, 17.0, 22.0, 29.0]  # as from other tracks: only the true height is common to all


def fused(height: list[float], least: int = 2, turn: list[float] = TURNS_M) -> tuple[float, float]:
    shape = (len(height), 1, 1)
    out, out_sigma = np.full((1, 1), 5.0), np.full((1, 1), 5.0)
    turns = np.array(turn[: len(height)]).reshape(shape)
    fuse_cells(np.array(height).reshape(shape), np.full(shape, 0.2), turns, least, 1.0, out, out_sigma)
    return float(out[0, 0]), float(out_sigma[0, 0])


def test_observations_that_agree_are_averaged_and_their_scatter_is_told() -> None:
    height, sigma = fused([7.0, 7.2])
    assert height == pytest.approx(7.1)
    assert sigma == pytest.approx(np.sqrt(0.2**2 / 2 + 0.1**2))


def test_an_observation_a_turn_off_is_brought_back() -> None:
    height, _ = fused([7.0, 7.1 + 13.0, 7.2])
    assert height == pytest.approx(7.1)


def test_two_that_differ_by_a_turn_common_to_both_tell_no_height() -> None:
    assert np.isnan(fused([7.0, 17.0], turn=[10.0, 10.0])).all()


def test_what_agrees_with_nothing_is_left_out() -> None:
    height, sigma = fused([7.0, 7.0, 11.5, 7.0, np.nan])
    assert height == pytest.approx(7.0)
    assert sigma == pytest.approx(0.2 / np.sqrt(3))


@pytest.mark.parametrize(("height", "least"), [([7.0, np.nan], 2), ([7.0, 11.5], 2), ([7.0, 11.5, 14.0], 3)])
def test_too_few_that_agree_are_unknown(height: list[float], least: int) -> None:
    assert np.isnan(fused(height, least)).all()


def test_one_observation_is_enough_only_where_one_is_asked_for() -> None:
    assert fused([7.0], least=1) == pytest.approx((7.0, 0.2))


def by_search(height: list[float]) -> float:
    """Return the mean of the observations moved by the cheapest turns of all, one search over everything."""
    best, best_cost = np.nan, np.inf
    for turns in itertools.product(range(-1, 2), repeat=len(height)):
        moved = np.array(height) + np.array(TURNS_M) * np.array(turns)
        for z in moved:
            cost = np.minimum(((moved - z) / 0.2) ** 2, 16.0).sum() + np.abs(turns).sum()
            if cost < best_cost:
                best, best_cost = moved.mean(), cost
    return float(best)


@pytest.mark.parametrize("seed", range(4))
def test_the_height_is_that_of_the_cheapest_turns(seed: int) -> None:
    rng = np.random.default_rng(seed)
    off = np.array([0, 0, 0, *rng.integers(-1, 2, 2)]) * TURNS_M
    height = (3.0 + off + rng.normal(0, 0.02, 5)).tolist()
    assert fused(height, least=3)[0] == pytest.approx(by_search(height), abs=1e-9)
