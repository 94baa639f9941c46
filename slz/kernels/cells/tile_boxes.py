"""Boxes of cells copied into tiles and from them."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from slz.kernels.argument_types import Array1D, Array2D, Array3D, Array4D
from slz.kernels.cells.cell_record import TILE, TILE_BITS
from slz.kernels.jit import kernel, kernel_for_any_types
from slz.kernels.raster.bitmap import NONE, Bits

Value = TypeVar("Value", np.float32, np.uint8)
Values = NDArray[Any]
Table = Array2D[np.int32]


@kernel_for_any_types
def _copy(there: Values, at: int, here: Values, first: int, n: int) -> None:
    """Copy n values between flat arrays, with unsigned indices, which need no check for negative ones."""
    to, by = np.uint64(at), np.uint64(first)
    for k in range(np.uint64(n)):
        there[to + k] = here[by + k]


@kernel_for_any_types
def _move(
    block: Values,
    first: int,
    table: Table,
    layer: int,
    row0: int,
    col0: int,
    cells: Values,
    inwards: bool,
) -> None:
    """Copy (rows, cols) cells of a layer to those of its tiles that are in a block, or from them."""
    rows, cols = cells.shape
    flat, given = block.ravel(), cells.ravel()
    tile_row, tile_col = row0 >> TILE_BITS, col0 >> TILE_BITS
    for tr in range(table.shape[0]):
        south = (tile_row + tr) << TILE_BITS
        for tc in range(table.shape[1]):
            slot = table[tr, tc] - first
            if slot < 0 or slot >= len(block):
                continue
            west = (tile_col + tc) << TILE_BITS
            c0, c1 = max(col0, west), min(col0 + cols, west + TILE)
            held = (slot * block.shape[1] + layer) * TILE
            for r in range(max(row0, south), min(row0 + rows, south + TILE)):
                there, here = (held + r - south) * TILE + c0 - west, (r - row0) * cols + c0 - col0
                if inwards:
                    _copy(flat, there, given, here, c1 - c0)
                else:
                    _copy(given, here, flat, there, c1 - c0)


@kernel
def put_layers(
    block: Array4D[Value], first: int, table: Table, row0: int, col0: int, values: Array3D[Value]
) -> None:
    """Write (layers, rows, cols) of a box to those of its tiles that are in a block.

    Parameters
    ----------
    block
        (tiles, layers, TILE, TILE), the first with slot `first`.
    table
        Slots of all tiles that the box touches, -1 for none.
    row0, col0
        South-west corner of the box.
    """
    for layer in range(len(values)):
        _move(block, first, table, layer, row0, col0, values[layer], True)


@kernel
def copy_layer(
    block: Array4D[Value], first: int, table: Table, layer: int, row0: int, col0: int, out: Array2D[Value]
) -> None:
    """Copy one layer of a box from those of its tiles that are in a block, see `put_layers`."""
    _move(block, first, table, layer, row0, col0, out, False)


@kernel
def set_bits(
    block: Array4D[np.uint8], first: int, table: Table, row0: int, value: np.uint8, out: Bits
) -> None:
    """Set the bits of the cells that hold a value, from the tiles in a block; a word is a row of a tile.

    Parameters
    ----------
    block, first, table
        As in `put_layers`, with one layer.
    out
        Rows from row0 on, and a word for each column of the table.
    """
    flat = block.ravel()
    for tr in range(table.shape[0]):
        south = ((row0 >> TILE_BITS) + tr) << TILE_BITS
        for tc in range(table.shape[1]):
            slot = table[tr, tc] - first
            if slot < 0 or slot >= len(block):
                continue
            for r in range(max(row0, south), min(row0 + len(out), south + TILE)):
                at, word = np.uint64((slot * TILE + r - south) * TILE), NONE
                for k in range(np.uint64(TILE)):
                    word |= np.uint64(flat[at + k] == value) << k
                out[r - row0, tc] = word


@kernel
def reach_of(cells: Array2D[np.int32]) -> tuple[int, int, int, int]:
    """Return the bounding box row0, row1, col0, col1 (half open) of at least one cell, (n, 2)."""
    row0 = row1 = cells[0, 0]
    col0 = col1 = cells[0, 1]
    for i in range(len(cells)):
        r, c = cells[i, 0], cells[i, 1]
        row0, row1, col0, col1 = min(row0, r), max(row1, r), min(col0, c), max(col1, c)
    return row0, row1 + 1, col0, col1 + 1


@kernel
def copy_cells(
    block: Array4D[np.float32],
    first: int,
    table: Table,
    layer: int,
    row0: int,
    col0: int,
    cells: Array2D[np.int32],
    down: int,
    right: int,
    out: Array1D[np.float32],
) -> None:
    """Copy one layer of (n, 2) cells, shifted down and right, from a box's tiles that are in a block."""
    for i in range(len(cells)):
        r, c = cells[i, 0] + down, cells[i, 1] + right
        slot = table[(r >> TILE_BITS) - (row0 >> TILE_BITS), (c >> TILE_BITS) - (col0 >> TILE_BITS)] - first
        if 0 <= slot < len(block):
            out[i] = block[slot, layer, r & (TILE - 1), c & (TILE - 1)]
