"""Median point density of a tiled survey, from counts over squares of about five metres."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from companion.desk.survey.point_density import BLOCK_M
from companion.desk.survey.tiled.cell_sums import segments
from companion.desk.survey.tiled.lattice import block_box
from slz import Box
from slz.kernels.survey.point_binning import BLOCK, BLOCK_BITS, count_squares

Tally = dict[int, int]  # number of squares by their number of points


def square_bits(cell_m: float) -> int:
    """Return log2 of the cells along a square's side: about `BLOCK_M`, a whole number of squares a block."""
    return min(BLOCK_BITS, max(0, round(math.log2(BLOCK_M / cell_m))))


def tally(paths: Sequence[Path], tile: Box, whole: Box, cell_m: float) -> Tally:
    """Return the histogram of points per square over a tile's blocks, without squares outside the survey."""
    bits = square_bits(cell_m)
    side = BLOCK >> bits
    squares: dict[tuple[int, int], np.ndarray] = {}
    for part in segments(paths, tile):
        count = squares.setdefault((part.row, part.col), np.zeros((side, side), np.int32))
        count_squares(part.cells, count, bits)
    found: Counter[int] = Counter()
    for (row, col), count in squares.items():
        box = block_box(row, col)
        rows = box.row0 + (np.arange(side) << bits)
        cols = box.col0 + (np.arange(side) << bits)
        step = 1 << bits
        held = (rows[:, None] + step > whole.row0) & (rows[:, None] < whole.row1)
        held = held & (cols[None, :] + step > whole.col0) & (cols[None, :] < whole.col1) & (count > 0)
        found.update(count[held].tolist())
    return dict(found)


def per_m2(tallies: Sequence[Tally], cell_m: float) -> float:
    """Return the median density (points/m²) of the squares that hold points; 0 without points."""
    found: Counter[int] = Counter()
    for one in tallies:
        found.update(one)
    if not found:
        return 0.0
    counts = np.array(sorted(found.items()), np.int64)
    below = np.cumsum(counts[:, 1])
    middle = counts[np.searchsorted(below, (below[-1] + 1) // 2), 0]
    side_m = cell_m * float(1 << square_bits(cell_m))
    return float(middle) / side_m**2
