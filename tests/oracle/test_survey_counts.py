"""Counts of a block's points by row, column and square of cells, against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.survey.point_binning import BLOCK, BLOCK_BITS, count_lines, count_squares, place

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
