"""A block's points by row, by column and by squares of cells, against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.gather import BLOCK, BLOCK_BITS, count_lines, count_squares

RNG = np.random.default_rng(5)
ROW, COL = RNG.integers(0, BLOCK, (2, 400))
CELL = (ROW << BLOCK_BITS | COL).astype(np.uint16)


def test_points_are_counted_by_row_and_by_column() -> None:
    rows, cols = np.ones(BLOCK, np.int64), np.zeros(BLOCK, np.int64)
    count_lines(CELL, rows, cols)
    np.testing.assert_array_equal(rows, 1 + np.bincount(ROW, minlength=BLOCK))
    np.testing.assert_array_equal(cols, np.bincount(COL, minlength=BLOCK))


@pytest.mark.parametrize("bits", [0, 1, 3])
def test_points_are_counted_by_squares_of_cells(bits: int) -> None:
    side = BLOCK >> bits
    count = np.zeros((side, side), np.int32)
    count_squares(CELL, count, bits)
    expected = np.zeros((side, side), np.int32)
    np.add.at(expected, (ROW >> bits, COL >> bits), 1)
    np.testing.assert_array_equal(count, expected)
