"""Morphological closing by squares of cells, against scipy.ndimage and plain Python."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from slz.kernels.raster.bitmap import packed, unpacked
from slz.kernels.raster.morphology import (
    above,
    closed,
    complement,
    dilated,
    enclosed,
    eroded,
    exceeds,
    minimum_filter,
)

seeds = st.integers(0, 10_000)


@settings(max_examples=60, deadline=None)
@given(seeds, st.integers(0, 12), st.sampled_from([0.01, 0.05, 0.2, 0.5, 0.9]))
def test_dilation_and_closing_are_those_of_scipy(seed: int, radius: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    known = rng.random((rng.integers(1, 40), rng.integers(1, 150))) < share
    square, cols, bits = (
        np.ones((2 * radius + 1, 2 * radius + 1)),
        known.shape[1],
        packed(known.view(np.uint8)),
    )
    wide = dilated(bits, radius, cols)
    np.testing.assert_array_equal(unpacked(wide, 0, cols), ndimage.binary_dilation(known, square))
    assert not unpacked(wide, cols, 64).any(), "beyond the map"
    expected = ndimage.binary_closing(known, square) | known  # scipy, too, takes the outside for unknown
    np.testing.assert_array_equal(unpacked(closed(bits, radius, cols), 0, cols), expected)


@settings(max_examples=60, deadline=None)
@given(seeds, st.sampled_from([0.5, 0.9, 0.99]))
def test_a_cell_is_enclosed_where_its_eight_neighbours_are_set(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    known = rng.random((rng.integers(1, 40), rng.integers(1, 150))) < share
    ring = np.ones((3, 3))
    ring[1, 1] = 0
    bits = enclosed(packed(known.view(np.uint8)), known.shape[1])
    expected = ndimage.binary_erosion(known, ring)
    np.testing.assert_array_equal(unpacked(bits, 0, known.shape[1]), expected)


@settings(max_examples=60, deadline=None)
@given(seeds, st.integers(0, 9))
def test_the_lowest_around_rises_with_every_row_and_column_that_it_is_away(seed: int, radius: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(0.0, 3.0, rng.integers(1, 24, 2)).astype(np.float32)
    values[rng.random(values.shape) < 0.5] = np.nan
    rise = np.float32(rng.uniform(0.0, 0.1))
    expected = np.full(values.shape, np.inf)
    for (row, col), value in np.ndenumerate(values):
        for (r, c), _ in np.ndenumerate(values):
            if max(abs(r - row), abs(c - col)) <= radius and not np.isnan(value):
                expected[r, c] = min(expected[r, c], value + rise * (abs(r - row) + abs(c - col)))
    cols, limit = values.shape[1], np.float32(0.7)
    lowest = minimum_filter(values, radius, rise)
    np.testing.assert_allclose(lowest[:, :cols], expected, rtol=0, atol=5e-6)
    bits = exceeds(values, lowest, limit)
    np.testing.assert_array_equal(unpacked(bits, 0, cols), values - lowest[:, :cols] > limit)
    assert not unpacked(bits, cols, -cols % 64).any()


def test_what_is_no_number_is_not_above_a_limit_and_what_is_not_set_ends_with_the_map() -> None:
    values = np.random.default_rng(0).random((5, 70)).astype(np.float32)
    values[::2, ::3] = np.nan
    bits = above(values, np.float32(0.4))
    np.testing.assert_array_equal(unpacked(bits, 0, 70), values > np.float32(0.4))
    np.testing.assert_array_equal(unpacked(complement(bits, 70), 0, 128)[:, :70], ~(values > np.float32(0.4)))
    assert not unpacked(complement(bits, 70), 70, 58).any()


@pytest.mark.parametrize("radius", [0, 1, 10, 31, 32, 70])
def test_erosion_is_that_of_scipy_however_wide_the_square(radius: int) -> None:
    rng = np.random.default_rng(radius)
    known = rng.random((160, 200)) < 0.9999
    side, bits = 2 * radius + 1, packed(known.view(np.uint8))
    expected = ndimage.minimum_filter(known, side, mode="constant", cval=0)
    np.testing.assert_array_equal(unpacked(eroded(bits, radius, 200), 0, 200), expected)
    np.testing.assert_array_equal(
        unpacked(dilated(complement(bits, 200), radius, 200), 0, 200),
        ndimage.maximum_filter(~known, side, mode="constant", cval=0),
    )
