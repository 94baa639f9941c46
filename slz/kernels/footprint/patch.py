"""Patch of cells under and around footprints, with heights relative to a nearby level."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array3D
from slz.kernels.cells.cell_record import BOTTOM, EXCESS, HEIGHT, SPREAD, TOP, WEIGHT
from slz.kernels.footprint.moments import INVERSE, KNOWN, LOWER, RETURN_NOISE, RISE, UPPER
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.simd import LANES, broadcast, load, store, where

MOST_ROWS, COLS = 16, 32  # footprints of a patch
SAMPLED_ROWS = 5  # rows and columns of a patch sampled for its median height, about
MOST_SAMPLED = 128

F0, F1, NAN = np.float32(0), np.float32(1), np.float32(np.nan)
HIGHEST, LOWEST = np.float32(np.inf), np.float32(-np.inf)
Row = Array1D[np.float32]
Layers = Array3D[np.float32]


@kernel
def rows_of_patch(radius: int) -> int:
    """Return the rows of footprints of a patch: a power of two, from 2 to the rows of one footprint."""
    rows = 2
    while 2 * rows <= min(MOST_ROWS, 2 * radius + 1):
        rows *= 2
    return rows


@kernel
def inverses(cells: Layers) -> Row:
    """Return 1 / number of returns of every cell, 0 where there is none."""
    weight = cells[WEIGHT].ravel()
    out = np.empty(len(weight), np.float32)
    for i in range(np.uint64(len(weight))):
        out[i] = F1 / weight[i] if weight[i] > F0 else F0
    return out


@kernel_part
def middle_height(cells: Layers, row: int, col: int, rows: int, cols: int, found: Row) -> np.float32:
    """Return the approximate median height of cells of a box; NaN where none is known.

    found: scratch, `MOST_SAMPLED` long.
    """
    north, east, n = min(row + rows, cells.shape[1]), min(col + cols, cells.shape[2]), 0
    for r in range(row, north, max(1, rows // SAMPLED_ROWS)):
        for c in range(col, east, max(1, cols // SAMPLED_ROWS)):
            if cells[WEIGHT, r, c] > F0 and n < MOST_SAMPLED:
                height, k = cells[HEIGHT, r, c], n
                while k > 0 and found[k - 1] > height:
                    found[k] = found[k - 1]
                    k -= 1
                found[k] = height
                n += 1
    if n > 0:
        return np.float32(found[n // 2])
    for r in range(row, north):
        for c in range(col, east):
            if cells[WEIGHT, r, c] > F0:
                return np.float32(cells[HEIGHT, r, c])
    return NAN


@kernel_part
def _gather_some_cells(
    cells: Row, inverse: Row, at: int, count: int, level: np.float32, held: Row, to: int, size: int
) -> None:
    """Write 16 cells, unknown from number `count` on, see `gather_cells`."""
    layer = len(inverse)
    for i in range(LANES):
        here = i < count and at + i < layer
        known = here and cells[WEIGHT * layer + at + i] > F0
        held[KNOWN * size + to + i] = F1 if known else F0
        held[RISE * size + to + i] = cells[HEIGHT * layer + at + i] - level if known else F0
        held[INVERSE * size + to + i] = inverse[at + i] if known else F0
        held[RETURN_NOISE * size + to + i] = cells[SPREAD * layer + at + i] if known else F0
        excess = cells[EXCESS * layer + at + i] if known else F0
        held[LOWER * size + to + i] = cells[BOTTOM * layer + at + i] - level + excess if known else HIGHEST
        held[UPPER * size + to + i] = cells[TOP * layer + at + i] - level - excess if known else LOWEST


@kernel_part
def gather_cells(
    cells: Row,
    inverse: Row,
    cols: int,
    row: int,
    col: int,
    tall: int,
    wide: int,
    level: np.float32,
    held: Row,
) -> None:
    """Write `tall` rows of `wide` cells from (row, col) on as layers of `slz.kernels.footprint.moments`.

    Parameters
    ----------
    cells, inverse
        (6, rows, cols) of `summarise` and their `inverses`, both flat. Cells outside are unknown.
    cols
        Columns of `cells`.
    """
    layer, size = len(inverse), tall * wide
    zero, over = broadcast(F0), broadcast(level)
    for i in range(tall):
        for c in range(0, wide, LANES):
            to, at = i * wide + c, (row + i) * cols + col + c
            if at + LANES > layer or col + c + LANES > cols:
                _gather_some_cells(cells, inverse, at, cols - col - c, level, held, to, size)
                continue
            known, excess = zero < load(cells, WEIGHT * layer + at), load(cells, EXCESS * layer + at)
            bottom, top = load(cells, BOTTOM * layer + at), load(cells, TOP * layer + at)
            store(held, KNOWN * size + to, where(known, broadcast(F1), zero))
            store(held, RISE * size + to, where(known, load(cells, HEIGHT * layer + at) - over, zero))
            store(held, INVERSE * size + to, load(inverse, at))
            store(held, RETURN_NOISE * size + to, where(known, load(cells, SPREAD * layer + at), zero))
            store(held, LOWER * size + to, where(known, (bottom - over) + excess, broadcast(HIGHEST)))
            store(held, UPPER * size + to, where(known, (top - over) - excess, broadcast(LOWEST)))
