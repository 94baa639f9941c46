"""Per-cell sums over a box of cells, joined from the sorted files that hold points of it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from companion.desk.survey.cloud_quality import BLOCK_M
from companion.desk.survey.tiled import array_file
from companion.desk.survey.tiled.census import EVERYTHING
from companion.desk.survey.tiled.lattice import UNIT_M, block_box, grown
from slz import Box
from slz.grid import common
from slz.kernels.survey.point_binning import BLOCK, BLOCK_BITS, count_squares, join
from slz.points.outliers import CLOUD_GROUP, in_cluster

RADIUS_M, LEAST = CLOUD_GROUP

Tally = dict[int, int]  # number of squares by their number of points


@dataclass(frozen=True, slots=True)
class Segment:
    """The points of one block in one sorted file."""

    row: int
    col: int
    cells: NDArray[np.uint16]
    heights: NDArray[np.int32]
    marks: NDArray[np.uint8]
    low: int
    high: int


@dataclass(frozen=True, slots=True)
class Sums:
    """Sums over a box of cells, see `join`. n_used, n_outliers: of the inner box."""

    box: Box
    count: NDArray[np.int32]
    total: NDArray[np.int64]
    extreme: NDArray[np.int32]
    n_used: int
    n_outliers: int


def segments(paths: Sequence[Path], box: Box) -> Iterator[Segment]:
    """Yield the points of all blocks that touch a box, file by file."""
    for path in paths:
        arrays, _ = array_file.read(path)
        blocks, ends = arrays["blocks"], arrays["ends"]
        touched = (
            (blocks[:, 0] * BLOCK < box.row1)
            & ((blocks[:, 0] + 1) * BLOCK > box.row0)
            & (blocks[:, 1] * BLOCK < box.col1)
            & ((blocks[:, 1] + 1) * BLOCK > box.col0)
        )
        for k in np.flatnonzero(touched).tolist():
            part = slice(int(ends[k - 1]) if k else 0, int(ends[k]))
            yield Segment(
                int(blocks[k, 0]),
                int(blocks[k, 1]),
                arrays["cells"][part],
                arrays["heights"][part],
                arrays["marks"][part],
                int(arrays["low"][k]),
                int(arrays["high"][k]),
            )


def join_cell_sums(
    paths: Sequence[Path], inner: Box, margin: int, whole: Box, interval: tuple[int, int], cell_m: float
) -> Sums:
    """Join all points of a box and its margin, without strays and outliers.

    Parameters
    ----------
    whole
        The survey's box, which overlaps the inner one; points beyond it are strays.
    interval
        Trusted heights. Points outside it count if they are in a group as `outliers.CLOUD_GROUP` defines it.
        Distances are between the centres of cells, and the radius is longer by a cell's diagonal: an outlier
        that counts adds a false obstacle, whereas a point lost could hide a true one.
    """
    box = common(grown(inner, margin), whole)
    rows, cols = box.shape
    count, total = np.zeros((rows, cols), np.int32), np.zeros((rows, cols), np.int64)
    extreme = np.zeros((rows, cols, 4), np.int32)
    radius_m = RADIUS_M + cell_m * math.sqrt(2)
    around = common(grown(box, math.ceil(radius_m / cell_m) + 1), whole)
    low, high = interval
    beyond: list[NDArray[np.int64]] = []
    for part in segments(paths, around):
        offset = block_box(part.row, part.col)
        place = (offset.row0 - box.row0, offset.col0 - box.col0, rows, cols)
        join(part.cells, part.heights, *place, low, high, count, total, extreme)
        if part.low < low or part.high > high:
            beyond.append(_beyond(part, offset, interval))
    n_outliers = 0
    if beyond:
        n_outliers = _join_groups(
            np.concatenate(beyond), around, box, inner, cell_m, radius_m, count, total, extreme
        )
    here = common(inner, box)
    n_used = int(
        count[here.row0 - box.row0 : here.row1 - box.row0, here.col0 - box.col0 : here.col1 - box.col0].sum()
    )
    return Sums(box, count, total, extreme, n_used, n_outliers)


def _beyond(part: Segment, offset: Box, interval: tuple[int, int]) -> NDArray[np.int64]:
    """Return (n, 3) row, column and height of the points outside the trusted heights."""
    heights = np.asarray(part.heights)
    held = np.flatnonzero((heights < interval[0]) | (heights > interval[1]))
    cells = part.cells[held].astype(np.int64)
    return np.column_stack(
        [offset.row0 + cells // BLOCK, offset.col0 + cells % BLOCK, heights[held].astype(np.int64)]
    )


def _join_groups(
    points: NDArray[np.int64],
    around: Box,
    box: Box,
    inner: Box,
    cell_m: float,
    radius_m: float,
    count: NDArray[np.int32],
    total: NDArray[np.int64],
    extreme: NDArray[np.int32],
) -> int:
    """Join the points beyond the interval that are in a group; return the number of lone inner ones."""
    points = points[_in(points, around)]
    places = points * np.array([cell_m, cell_m, UNIT_M])
    grouped = in_cluster(places, radius_m, LEAST)
    counted = points[grouped & _in(points, box)]
    rows, cols = box.shape
    for row, col in {(int(r), int(c)) for r, c in counted[:, :2] // BLOCK}:
        own = counted[(counted[:, :2] // BLOCK == (row, col)).all(axis=1)]
        cells = (own[:, 0] % BLOCK * BLOCK + own[:, 1] % BLOCK).astype(np.uint16)
        offset = block_box(row, col)
        place = (offset.row0 - box.row0, offset.col0 - box.col0, rows, cols)
        join(cells, own[:, 2].astype(np.int32), *place, *EVERYTHING, count, total, extreme)
    return int(np.count_nonzero(~grouped & _in(points, inner)))


def _in(points: NDArray[np.int64], box: Box) -> NDArray[np.bool_]:
    return (
        (points[:, 0] >= box.row0)
        & (points[:, 0] < box.row1)
        & (points[:, 1] >= box.col0)
        & (points[:, 1] < box.col1)
    )


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
