"""Sums of survey points in surface cells, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.survey.point_binning import BLOCK, BLOCK_BITS
from slz.kernels.survey.surface_sums import CLASS_SHIFT, CLASSES, add_sums, count_apart

ROW0, COL0, FACTOR, SHAPE = -20, 30, 4, (30, 41)
LOW, HIGH, DATUM, APART = 1000, 9000, 900, 2500.0
N = 20_000


def block() -> tuple[NDArray[np.uint16], NDArray[np.int32], NDArray[np.uint8]]:
    rng = np.random.default_rng(1)
    row, col = rng.integers(0, BLOCK, (2, N))
    marks = rng.choice([0, 1, 3], N) | (rng.integers(0, CLASSES, N) << int(CLASS_SHIFT))
    return (
        ((row << BLOCK_BITS) | col).astype(np.uint16),
        rng.integers(0, 10_000, N).astype(np.int32),
        marks.astype(np.uint8),
    )


def places(cell: NDArray[np.uint16], height: NDArray[np.int32]) -> NDArray[np.intp]:
    """Return the surface cell of each point as one number, -1 for none."""
    row, col = ROW0 + (cell.astype(int) >> BLOCK_BITS), COL0 + (cell.astype(int) & (BLOCK - 1))
    in_reach = (row >= 0) & (col >= 0) & (height >= LOW) & (height <= HIGH)
    row, col = row // FACTOR, col // FACTOR
    in_reach &= (row < SHAPE[0]) & (col < SHAPE[1])
    return np.where(in_reach, row * SHAPE[1] + col, -1)


def summed(order: NDArray[np.intp]) -> list[NDArray[np.integer]]:
    cell, height, mark = block()
    cell, height, mark = cell[order], height[order], mark[order]
    sums, extreme = np.zeros((5, *SHAPE), np.int64), np.zeros((*SHAPE, 2), np.int32)
    classes = np.zeros((*SHAPE, CLASSES), np.int32)
    for part in np.array_split(np.arange(N), 3):
        add_sums(
            cell[part], height[part], mark[part], ROW0, COL0, FACTOR, LOW, HIGH, DATUM, sums, extreme, classes
        )
    return [sums, extreme, classes]


def test_sums_extremes_and_classes_are_those_of_each_cell_s_points() -> None:
    cell, height, mark = block()
    at, size = places(cell, height), SHAPE[0] * SHAPE[1]
    used = at >= 0
    over = height[used].astype(np.int64) - DATUM
    told, several = mark[used] & 1, mark[used] >> 1 & 1
    sums, extreme, classes = summed(np.arange(N))
    for found, weights in zip(sums, (over**0, over, over**2, told, several), strict=True):
        np.testing.assert_array_equal(found.ravel(), np.bincount(at[used], weights, size))
    kind = mark[used] >> CLASS_SHIFT
    for k in range(CLASSES):
        np.testing.assert_array_equal(
            classes[..., k].ravel(), np.bincount(at[used][kind == k], minlength=size)
        )
    for one in np.unique(at[used])[::40]:
        own = height[at == one]
        assert extreme.reshape(-1, 2)[one].tolist() == [own.min(), own.max()]


@pytest.mark.parametrize("seed", [1, 2])
def test_the_order_of_points_does_not_matter(seed: int) -> None:
    expected = summed(np.arange(N))
    for found, before in zip(summed(np.random.default_rng(seed).permutation(N)), expected, strict=True):
        np.testing.assert_array_equal(found, before)


def test_points_apart_from_their_cell_s_mean_are_counted() -> None:
    cell, height, _ = block()
    at, size = places(cell, height), SHAPE[0] * SHAPE[1]
    mean = np.random.default_rng(2).uniform(4000, 6000, SHAPE)
    deep, tall = np.zeros(SHAPE, np.int32), np.zeros(SHAPE, np.int32)
    count_apart(cell, height, ROW0, COL0, FACTOR, LOW, HIGH, mean, APART, deep, tall)
    off = height - mean.ravel()[at]
    for found, side in ((deep, off < -APART), (tall, off > APART)):
        expected = np.bincount(at[side & (at >= 0)], minlength=size)
        np.testing.assert_array_equal(found.ravel(), expected)
        assert expected.any()
