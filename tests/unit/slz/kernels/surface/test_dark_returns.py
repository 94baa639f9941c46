"""Dark returns: several of them around a cell, more than bright ones, are of water."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from slz.kernels.surface.masks import box_sums
from slz.kernels.surface.surface_record import DARK
from slz.kernels.surface.water_returns import dark_returns
from tests.unit.slz.surface.made_ground import SUSPICION, classify, lake, made, with_fields

LAKE = made(lake(8.0), 80)


NOWHERE = np.zeros(LAKE.shape, bool)


def told(dark: NDArray[np.floating], level: NDArray[np.bool_] = NOWHERE) -> NDArray[np.float32]:
    return dark_returns(with_fields(LAKE, {DARK: dark}).fields, level)


def at(row: int, col: int, value: float) -> NDArray[np.float64]:
    out = np.zeros(LAKE.shape)
    out[row, col] = value
    return out


def test_dark_returns_of_a_cell_tell_of_it_and_its_silent_neighbours() -> None:
    score = told(at(40, 40, 6))
    assert np.argwhere(score > 0).tolist() == [[r, c] for r in (39, 40, 41) for c in (39, 40, 41)]


def test_few_dark_returns_tell_nothing() -> None:
    assert not told(at(40, 40, 5)).any()


def test_bright_returns_outweigh_dark_ones_around_and_acquit_their_own_cell() -> None:
    assert told(at(40, 40, 6) + at(40, 41, -1))[40, 40] == 0
    score = told(at(40, 40, 60) + at(40, 41, -1))
    assert score[40, 40] > 0
    assert score[40, 41] == 0


def test_bright_ground_is_not_told_from_ground_of_unknown_brightness() -> None:
    assert not told(np.full(LAKE.shape, -100.0)).any()


def test_dark_level_ground_is_water_though_it_answers_obliquely() -> None:
    dark = with_fields(made(lambda x, _: 0 * x, 40), {DARK: 20.0})
    assert classify(dark).water.min() > SUSPICION
    assert classify(with_fields(dark, {DARK: -20.0})).water.max() <= SUSPICION


def test_what_was_seen_from_above_alone_is_as_dark_as_its_level_extent() -> None:
    """A strip that shines from above, amid murky water."""
    strip, level = np.arange(80) == 40, ~NOWHERE
    dark = np.where(np.abs(np.arange(80) - 40) < 5, 0, 3) + 0 * at(0, 0, 0)
    assert (told(dark, level)[10:-10, strip] > 0).all()
    assert not told(dark)[:, strip].any()
    assert not told(-dark, level).any()
    brighter = np.where(strip, -1, dark)
    assert not told(brighter, level)[:, strip].any()


# Sums over squares of cells, against SciPy.


SHAPES = [(1, 1), (1, 7), (6, 2), (17, 23)]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("radius", [0, 1, 2, 10])
def test_box_sums_are_those_of_a_correlation_with_ones(shape: tuple[int, int], radius: int) -> None:
    layers = np.random.default_rng(1).uniform(0, 50, (3, *shape)).astype(np.float32)
    ones = np.ones((2 * radius + 1, 2 * radius + 1))
    expected = [ndimage.correlate(layer.astype(np.float64), ones, mode="constant") for layer in layers]
    np.testing.assert_allclose(box_sums(layers, radius), expected, rtol=1e-5)
