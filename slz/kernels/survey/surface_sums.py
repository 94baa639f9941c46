"""Sums of survey points in surface cells, in integers, so that they do not depend on the points' order."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D, Int32, Strided2D
from slz.kernels.jit import kernel
from slz.kernels.survey.point_binning import BLOCK, BLOCK_BITS

# Bits of a point's mark: whether its number of returns is known, whether it is more than one, its class.
NUMBERED, SEVERAL, CLASS_SHIFT = np.uint8(1), np.uint8(2), np.uint8(2)
# Classes, in the mark and in `classes`.
UNCLASSIFIED, GROUND, LOW_PLANT, TALL_PLANT, BUILDING = range(5)
CLASSES = 5


@kernel
def add_sums(
    cell: Array1D[np.uint16],
    height: Array1D[np.int32],
    mark: Array1D[np.uint8],
    row0: int,
    col0: int,
    factor: int,
    low: Int32,
    high: Int32,
    datum: int,
    sums: Array3D[np.int64],
    extreme: Array3D[np.int32],
    classes: Array3D[np.int32],
) -> None:
    """Add a block's points from `low` to `high` to the sums of the surface cells that hold them.

    Parameters
    ----------
    row0, col0, factor
        First near cell of the block, counted from the first near cell of the sums; near cells along the side
        of a surface cell.
    sums
        (5, rows, cols): points, their heights over `datum`, squares of these, numbered and several returns.
    extreme
        (rows, cols, 2) lowest and highest.
    classes
        (rows, cols, CLASSES) points.
    """
    rows, cols = extreme.shape[0], extreme.shape[1]
    for i in range(len(cell)):
        at, h = np.int64(cell[i]), height[i]
        r, c = row0 + (at >> BLOCK_BITS), col0 + (at & (BLOCK - 1))
        if r < 0 or c < 0 or h < low or h > high:
            continue
        r, c = r // factor, c // factor
        if r >= rows or c >= cols:
            continue
        over = np.int64(h) - datum
        if sums[0, r, c] == 0:
            extreme[r, c, 0] = extreme[r, c, 1] = h
        else:
            extreme[r, c, 0], extreme[r, c, 1] = min(extreme[r, c, 0], h), max(extreme[r, c, 1], h)
        sums[0, r, c] += 1
        sums[1, r, c] += over
        sums[2, r, c] += over * over
        sums[3, r, c] += mark[i] & NUMBERED
        sums[4, r, c] += (mark[i] & SEVERAL) >> 1
        kind = np.int64(mark[i] >> CLASS_SHIFT)
        if kind < CLASSES:
            classes[r, c, kind] += 1


@kernel
def count_apart(
    cell: Array1D[np.uint16],
    height: Array1D[np.int32],
    row0: int,
    col0: int,
    factor: int,
    low: Int32,
    high: Int32,
    mean: Strided2D[np.float64],
    apart: float,
    deep: Array2D[np.int32],
    tall: Array2D[np.int32],
) -> None:
    """Count the points lower, and higher, than the mean of their surface cell by `apart` (height units)."""
    rows, cols = deep.shape
    for i in range(len(cell)):
        at, h = np.int64(cell[i]), height[i]
        r, c = row0 + (at >> BLOCK_BITS), col0 + (at & (BLOCK - 1))
        if r < 0 or c < 0 or h < low or h > high:
            continue
        r, c = r // factor, c // factor
        if r < rows and c < cols:
            deep[r, c] += h < mean[r, c] - apart
            tall[r, c] += h > mean[r, c] + apart
