"""Patch of cells under and around footprints, with heights relative to a nearby level."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array3D
from slz.kernels.cells.cell_record import BOTTOM, EXCESS, HEIGHT, SPREAD, SUMMARY_LAYERS, TOP, WEIGHT
from slz.kernels.footprint.moments import INVERSE, KNOWN, LOWER, RETURN_NOISE, RISE, UPPER
from slz.kernels.jit import kernel, kernel_part

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
def gather_cells(
    cells: Row, cols: int, row: int, col: int, tall: int, wide: int, level: np.float32, held: Row
) -> None:
    """Write `tall` rows of `wide` cells from (row, col) on as layers of `slz.kernels.footprint.moments`.

    cells: (6, rows, cols) of `summarise`, flat; those outside are unknown. There is a loop for each layer,
    which the compiler vectorises, as it does not one of all.
    """
    size, layer, n = tall * wide, len(cells) // SUMMARY_LAYERS, np.uint64(min(wide, cols - col))
    if col + wide > cols or row + tall > layer // cols:
        held[: LOWER * size], held[LOWER * size : UPPER * size], held[UPPER * size :] = F0, HIGHEST, LOWEST
    for i in range(min(tall, layer // cols - row)):
        at, to = (row + i) * cols + col, i * wide
        weight, excess = np.uint64(WEIGHT * layer + at), np.uint64(EXCESS * layer + at)
        known, inverse = np.uint64(KNOWN * size + to), np.uint64(INVERSE * size + to)
        for k in range(n):
            held[known + k] = F1 if cells[weight + k] > F0 else F0
        for k in range(n):
            held[inverse + k] = F1 / cells[weight + k] if cells[weight + k] > F0 else F0
        height, rise = np.uint64(HEIGHT * layer + at), np.uint64(RISE * size + to)
        for k in range(n):
            held[rise + k] = cells[height + k] - level if cells[weight + k] > F0 else F0
        spread, noise = np.uint64(SPREAD * layer + at), np.uint64(RETURN_NOISE * size + to)
        for k in range(n):
            held[noise + k] = cells[spread + k] if cells[weight + k] > F0 else F0
        bottom, low = np.uint64(BOTTOM * layer + at), np.uint64(LOWER * size + to)
        for k in range(n):
            height_m = cells[bottom + k] - level + cells[excess + k]
            held[low + k] = height_m if cells[weight + k] > F0 else HIGHEST
        top, high = np.uint64(TOP * layer + at), np.uint64(UPPER * size + to)
        for k in range(n):
            height_m = cells[top + k] - level - cells[excess + k]
            held[high + k] = height_m if cells[weight + k] > F0 else LOWEST
