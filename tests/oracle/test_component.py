"""Connected components of wide bitmaps, against a plain flood fill."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from slz.kernels.polygons.boundary_tracing import westmost
from slz.kernels.raster.bitmap import packed, unpacked
from slz.kernels.raster.region_fill import component

COLS = 64 * 5
EIGHT = np.ones((3, 3), int)


def maze(seed: int, rows: int = 61) -> NDArray[np.uint8]:
    """Return walls with few gaps one behind another, so that the way through goes to and fro."""
    rng = np.random.default_rng(seed)
    cells = np.ones((rows, COLS), np.uint8)
    cells[2::4] = 0
    for row in range(2, rows, 4):
        cells[row, rng.integers(0, COLS, 2)] = 1
    cells[rng.random(cells.shape) < 0.1 + 0.2 * rng.random()] = 0
    return cells


def speckle(seed: int) -> NDArray[np.uint8]:
    rng = np.random.default_rng(seed)
    return (rng.random((70, COLS)) < 0.35 + 0.3 * rng.random()).astype(np.uint8)


def comb(seed: int) -> NDArray[np.uint8]:
    """Return teeth that hang together at one end only, south and north in turn, and whole words of cells."""
    cells = np.ones((40, COLS), np.uint8)
    cells[1:, 3::6] = 0
    cells[:-1, 6::6] = 0
    cells[:, 64 : 64 * (2 + seed % 3)] = 1
    return cells


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("make", [maze, speckle, comb])
def test_a_component_is_all_that_a_flood_reaches(make: object, seed: int) -> None:
    assert callable(make)
    cells = make(seed)
    label, count = ndimage.label(cells, EIGHT)
    rng = np.random.default_rng(seed)
    largest = 1 + int(np.argmax(np.bincount(label.ravel())[1:]))
    for number in {largest, *(1 + rng.integers(0, count, 6)).tolist()}:
        places = np.argwhere(label == number)
        for row, col in places[rng.integers(0, len(places), 3)].tolist():
            found = unpacked(component(packed(cells), row, col), 0, COLS)
            np.testing.assert_array_equal(found, label == number)


def test_the_westmost_cell_of_a_run_is_found_over_words() -> None:
    rng = np.random.default_rng(4)
    cells = (rng.random((40, COLS)) < 0.97).astype(np.uint8)
    cells[:, 0] = 0
    cells[0, 1:], cells[1, 64:192] = 1, 1
    bits = packed(cells)
    for row, col in np.argwhere(cells)[::7].tolist():
        first = col
        while cells[row, first - 1]:
            first -= 1
        assert westmost(bits, row, col) == first
