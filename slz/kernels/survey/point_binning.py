"""Binning of survey points: sort into blocks of cells, and per-cell statistics in integers.

Integer counts, sums, minima and maxima do not depend on the order of the points. So a cell's evidence is
bit-identical however the points were split and whoever added them.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D, Array4D, Int32, Strided2D, Strided3D
from slz.kernels.cells.cell_record import COUNT, FIELDS, HIGH, HIGH2, LOW, LOW2, MEAN, NOISE
from slz.kernels.jit import kernel, kernel_part

BLOCK_BITS = 8
BLOCK = 1 << BLOCK_BITS  # cells along the side of a block
MOST_INDEX = 2.0**30  # bound on a row or column


@kernel_part
def _find(blocks: Array2D[np.int64], slots: Array1D[np.int64], row: int, col: int) -> int:
    """Return the hash slot of a block's number, or the empty slot (-1) for it."""
    mask = len(slots) - 1
    at = ((row * 0x9E3779B1 + col * 0x85EBCA77) >> 7) & mask
    while slots[at] >= 0 and (blocks[slots[at], 0] != row or blocks[slots[at], 1] != col):
        at = (at + 1) & mask
    return at


@kernel
def rehash(blocks: Array2D[np.int64], n_blocks: int, slots: Array1D[np.int64]) -> None:
    """Enter blocks into an empty hash table whose length is a power of two above twice their number."""
    for i in range(n_blocks):
        slots[_find(blocks, slots, blocks[i, 0], blocks[i, 1])] = i


@kernel
def place(
    x: Array1D[np.float64],
    y: Array1D[np.float64],
    z: Array1D[np.float64],
    keep: Array1D[np.bool_],
    x_cells: float,
    y_cells: float,
    z_units: float,
    most_height: float,
    blocks: Array2D[np.int64],
    slots: Array1D[np.int64],
    n_blocks: int,
    mark: Array1D[np.uint8],
    cell: Array1D[np.uint16],
    height: Array1D[np.int32],
    block: Array1D[np.int32],
    marked: Array1D[np.uint8],
) -> tuple[int, int]:
    """Find block, cell and height of the points to keep; return the numbers of points and of blocks.

    x_cells, y_cells: cells per unit of x and y, from the origin of the CRS. z_units: units of height per unit
    of z. Points higher than most_height units or outside the index range are skipped. New blocks (row, col)
    go into `blocks` and their hash table `slots` (length a power of two, -1 where empty); when `blocks` is
    full, the number of points is -1. `cell`, `height`, `block` and `marked` receive cell, height, block
    number and mark of each point.
    """
    n, last, last_row, last_col = 0, -1, 0, 0
    for i in range(len(x)):
        if not keep[i]:
            continue
        across, up, h = x[i] * x_cells, y[i] * y_cells, np.rint(z[i] * z_units)
        if not (abs(across) < MOST_INDEX and abs(up) < MOST_INDEX and abs(h) < most_height):
            continue
        c, r = int(np.floor(across)), int(np.floor(up))
        bc, br = c >> BLOCK_BITS, r >> BLOCK_BITS
        if last < 0 or bc != last_col or br != last_row:
            at = _find(blocks, slots, br, bc)
            if slots[at] < 0:
                if n_blocks == len(blocks):
                    return -1, n_blocks
                blocks[n_blocks, 0], blocks[n_blocks, 1] = br, bc
                slots[at] = n_blocks
                n_blocks += 1
            last, last_row, last_col = slots[at], br, bc
        cell[n] = ((r & (BLOCK - 1)) << BLOCK_BITS) | (c & (BLOCK - 1))
        height[n], block[n], marked[n] = int(h), last, mark[i]
        n += 1
    return n, n_blocks


@kernel
def by_block(
    block: Array1D[np.int32],
    cell: Array1D[np.uint16],
    height: Array1D[np.int32],
    mark: Array1D[np.uint8],
    place_of: Array1D[np.int64],
    cell_out: Array1D[np.uint16],
    height_out: Array1D[np.int32],
    mark_out: Array1D[np.uint8],
) -> None:
    """Sort points by block; place_of holds the start of each block, and is modified."""
    for i in range(len(block)):
        at = place_of[block[i]]
        cell_out[at], height_out[at], mark_out[at] = cell[i], height[i], mark[i]
        place_of[block[i]] = at + 1


@kernel
def count_lines(cell: Array1D[np.uint16], rows: Array1D[np.int64], cols: Array1D[np.int64]) -> None:
    """Count a block's points by row and by column."""
    for i in range(len(cell)):
        rows[cell[i] >> BLOCK_BITS] += 1
        cols[cell[i] & (BLOCK - 1)] += 1


@kernel
def count_heights(height: Array1D[np.int32], units: float, first: int, count: Array1D[np.int64]) -> None:
    """Count points by height, in bins of `units` units; the first bin has the number `first`."""
    for i in range(len(height)):
        count[int(np.floor(height[i] / units)) - first] += 1


@kernel
def count_squares(cell: Array1D[np.uint16], count: Array2D[np.int32], bits: int) -> None:
    """Count a block's points by squares of 2^bits cells."""
    for i in range(len(cell)):
        count[cell[i] >> (BLOCK_BITS + bits), (cell[i] & (BLOCK - 1)) >> bits] += 1


@kernel
def join(
    cell: Array1D[np.uint16],
    height: Array1D[np.int32],
    row0: int,
    col0: int,
    rows: int,
    cols: int,
    low: Int32,
    high: Int32,
    count: Array2D[np.int32],
    total: Array2D[np.int64],
    extreme: Array3D[np.int32],
) -> int:
    """Add a block's points from `low` to `high` to the statistics of rows x cols cells; return how many.

    The block's first cell is (row0, col0) of these cells; points outside are skipped. extreme: lowest, second
    lowest, highest and second highest of each cell, undefined where the count is 0.
    """
    n = 0
    for i in range(len(cell)):
        at, h = np.int64(cell[i]), height[i]
        r, c = row0 + (at >> BLOCK_BITS), col0 + (at & (BLOCK - 1))
        if r < 0 or c < 0 or r >= rows or c >= cols or h < low or h > high:
            continue
        n += 1
        total[r, c] += h
        count[r, c] += 1
        e = extreme[r, c]
        if count[r, c] == 1:
            e[0] = e[1] = e[2] = e[3] = h
        elif count[r, c] == 2:
            e[1] = e[2] = max(e[0], h)
            e[0] = e[3] = min(e[0], h)
        else:
            if h < e[0]:
                e[1], e[0] = e[0], h
            elif h < e[1]:
                e[1] = h
            if h > e[2]:
                e[3], e[2] = e[2], h
            elif h > e[3]:
                e[3] = h
    return n


@kernel
def evidence_of(
    count: Strided2D[np.int32],
    total: Strided2D[np.int64],
    extreme: Strided3D[np.int32],
    datum: int,
    unit_m: float,
    noise_m: float,
) -> Array4D[np.float32]:
    """Return the evidence (rows, cols, 2, FIELDS) of the sums: one epoch, heights above `datum` (m)."""
    rows, cols = count.shape
    out = np.zeros((rows, cols, 2, FIELDS), np.float32)
    variance = np.float32(noise_m * noise_m)
    for r in range(rows):
        for c in range(cols):
            n = count[r, c]
            if n == 0:
                continue
            now, e = out[r, c, 0], extreme[r, c]
            now[COUNT], now[NOISE] = n, variance
            now[MEAN] = (total[r, c] - n * datum) / n * unit_m
            now[LOW], now[LOW2] = (e[0] - datum) * unit_m, (e[1] - datum) * unit_m
            now[HIGH], now[HIGH2] = (e[2] - datum) * unit_m, (e[3] - datum) * unit_m
    return out
