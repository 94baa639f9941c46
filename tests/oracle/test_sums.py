"""Sums of heights by cell against hand-made results, for any order of the points."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.paper.height_sums import sum_heights
from slz.kernels.paper.point_pass import DROPPED, OUTSIDE

COUNT_BITS, SCALE, LEVEL, LOW, HIGH = 8, 1024.0, 50.0, 48.0, 53.0
ROW0, ROWS, COL0, COLS = 3, 70, 5, 9


def window(seed: int, n: int = 300) -> tuple[NDArray[np.float64], NDArray[np.uint32], NDArray[np.float32]]:
    rng = np.random.default_rng(seed)
    points = np.zeros((n, 3))
    points[:, 2] = rng.uniform(47.5, 53.5, n)
    points[:4, 2] = LOW, HIGH, np.nextafter(LOW, 0), np.nextafter(HIGH, 99)
    cells = ((ROW0 + rng.integers(0, ROWS, n)) << 16 | (COL0 + rng.integers(0, COLS, n))).astype(np.uint32)
    cells[10:20], cells[20:30] = DROPPED, OUTSIDE
    return points, cells, (points[:, 2] - LEVEL).astype(np.float32)


def by_hand(points: NDArray[np.float64], cells: NDArray[np.uint32]) -> tuple[int, NDArray[np.uint64]]:
    used, sums = 0, [0] * (ROWS * COLS)
    for z, cell in zip(points[:, 2], cells.tolist(), strict=True):
        if cell == DROPPED or not LOW <= z <= HIGH:
            continue
        used += 1
        if cell != OUTSIDE:
            over = int((float(np.float32(z - LEVEL)) + LEVEL - LOW) * SCALE + 0.5)
            sums[((cell >> 16) - ROW0) * COLS + (cell & 0xFFFF) - COL0] += (over << COUNT_BITS) + 1
    return used, np.array(sums, np.uint64)


@pytest.mark.parametrize("n", [30, 64, 300, 1000])
@pytest.mark.parametrize("seed", range(4))
def test_sums_and_counts_are_those_by_hand_in_any_order(seed: int, n: int) -> None:
    points, cells, heights = window(seed, n)
    used, expected = by_hand(points, cells)
    mixed = np.random.default_rng(seed).permutation(n)
    found = []
    for order in (np.arange(n), np.argsort(cells, kind="stable"), mixed):
        flat, sums = points[order].ravel(), np.zeros(ROWS * COLS, np.uint64)
        flat.flags.writeable = False
        limits = LEVEL, LOW, HIGH, SCALE, COUNT_BITS, ROW0, COL0, COLS
        assert sum_heights(flat, cells[order], heights[order], *limits, sums) == used
        found.append(sums)
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])
    np.testing.assert_array_equal(found[0] & np.uint64(255), expected & np.uint64(255))
    heights_of = (found[0] >> np.uint64(8)).astype(np.int64) - (expected >> np.uint64(8)).astype(np.int64)
    assert abs(heights_of).max() <= 1  # of 1 / 1024 m: at the ends the height is taken in full precision
