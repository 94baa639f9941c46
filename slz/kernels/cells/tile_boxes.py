"""Boxes of cells copied into tiles and from them."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from slz.kernels.argument_types import Array2D, Array3D, Array4D, ReadOnly2D
from slz.kernels.cells.cell_record import TILE, TILE_BITS
from slz.kernels.footprint.patch import COLS
from slz.kernels.jit import kernel, kernel_at_call, kernel_for_any_types, kernel_part
from slz.kernels.raster.bitmap import ALL, NONE, ONE, Bits, word_at, word_mask

Value = TypeVar("Value", np.float32, np.uint8)
Values = NDArray[Any]
Table = Array2D[np.int32]
LARGEST = 2**62


@kernel_for_any_types
def _copy(there: Values, at: int, here: Values, first: int, n: int) -> None:
    """Copy n values between flat arrays, with unsigned indices, which need no check for negative ones."""
    to, by = np.uint64(at), np.uint64(first)
    for k in range(np.uint64(n)):
        there[to + k] = here[by + k]


@kernel_for_any_types
def _move(
    pool: Values,
    table: Table,
    layer: int,
    row0: int,
    col0: int,
    cells: Values,
    inwards: bool,
) -> None:
    """Copy (rows, cols) cells of a layer to those of its tiles that are held, or from them."""
    rows, cols = cells.shape
    flat, given = pool.ravel(), cells.ravel()
    tile_row, tile_col = row0 >> TILE_BITS, col0 >> TILE_BITS
    for tr in range(table.shape[0]):
        south = (tile_row + tr) << TILE_BITS
        for tc in range(table.shape[1]):
            slot = table[tr, tc]
            if slot < 0:
                continue
            west = (tile_col + tc) << TILE_BITS
            c0, c1 = max(col0, west), min(col0 + cols, west + TILE)
            held = (slot * pool.shape[1] + layer) * TILE
            for r in range(max(row0, south), min(row0 + rows, south + TILE)):
                there, here = (held + r - south) * TILE + c0 - west, (r - row0) * cols + c0 - col0
                if inwards:
                    _copy(flat, there, given, here, c1 - c0)
                else:
                    _copy(given, here, flat, there, c1 - c0)


@kernel_at_call
def put_layers(pool: Array4D[Value], table: Table, row0: int, col0: int, values: Array3D[Value]) -> None:
    """Write (layers, rows, cols) of a box to those of its tiles that are held.

    Parameters
    ----------
    pool
        (slots, layers, TILE, TILE).
    table
        Slots of all tiles that the box touches, -1 for none.
    row0, col0
        South-west corner of the box.
    """
    for layer in range(len(values)):
        _move(pool, table, layer, row0, col0, values[layer], True)


@kernel
def copy_layer(
    pool: Array4D[Value], table: Table, layer: int, row0: int, col0: int, out: Array2D[Value]
) -> None:
    """Copy one layer of a box from those of its tiles that are held, see `put_layers`."""
    _move(pool, table, layer, row0, col0, out, False)


@kernel
def set_bits(pool: Array4D[np.uint8], table: Table, row0: int, value: np.uint8, out: Bits) -> None:
    """Set the bits of the cells that hold a value, from the tiles held; a word is a row of a tile.

    Parameters
    ----------
    pool, table
        As in `put_layers`, with one layer.
    out
        Rows from row0 on, and a word for each column of the table.
    """
    flat = pool.ravel()
    for tr in range(table.shape[0]):
        south = ((row0 >> TILE_BITS) + tr) << TILE_BITS
        for tc in range(table.shape[1]):
            slot = table[tr, tc]
            if slot < 0:
                continue
            for r in range(max(row0, south), min(row0 + len(out), south + TILE)):
                at, word = np.uint64((slot * TILE + r - south) * TILE), NONE
                for k in range(np.uint64(TILE)):
                    word |= np.uint64(flat[at + k] == value) << k
                out[r - row0, tc] = word


@kernel_part
def or_word(out: Bits, row: int, col: int, word: np.uint64) -> None:
    """Set the bits of a word in the 64 cells of a row from a column on; cells outside are left out."""
    k, shift = col >> 6, np.uint64(col & 63)
    if 0 <= k < out.shape[1]:
        out[row, k] |= word << shift
    if shift != NONE and -1 <= k < out.shape[1] - 1:
        out[row, k + 1] |= word >> (np.uint64(64) - shift)


@kernel
def copy_bits(pool: Array3D[np.uint64], which: int, table: Table, row0: int, col0: int, out: Bits) -> None:
    """Set the bits of a box from the bitmaps of those of its tiles that are held.

    Parameters
    ----------
    pool, which
        (slots, bitmaps, TILE), a word for each row of a tile, and the bitmap to copy.
    out
        Bits of the box; its last words may extend beyond, and get the bits there of the table's tiles.
    """
    for tr in range(table.shape[0]):
        south = ((row0 >> TILE_BITS) + tr) << TILE_BITS
        for tc in range(table.shape[1]):
            slot, west = table[tr, tc], ((col0 >> TILE_BITS) + tc) << TILE_BITS
            if slot < 0:
                continue
            for r in range(max(row0, south), min(row0 + len(out), south + TILE)):
                or_word(out, r - row0, west - col0, pool[slot, which, r - south])


@kernel
def put_bits(
    pool: Array3D[np.uint64],
    which: int,
    table: Table,
    row0: int,
    col0: int,
    bits: Bits,
    edge: int,
    cols: int,
) -> None:
    """Write bits of a box to the bitmaps of those of its tiles that are held, see `copy_bits`.

    Parameters
    ----------
    bits, edge, cols
        Bitmap of the box with a margin, which is left out, and the columns of the box.
    """
    rows = len(bits) - 2 * edge
    for tr in range(table.shape[0]):
        south = ((row0 >> TILE_BITS) + tr) << TILE_BITS
        for tc in range(table.shape[1]):
            slot, west = table[tr, tc], ((col0 >> TILE_BITS) + tc) << TILE_BITS
            if slot < 0 or west >= col0 + cols or west + TILE <= col0:
                continue
            mask = word_mask(col0 - west, col0 + cols - west)
            for r in range(max(row0, south), min(row0 + rows, south + TILE)):
                word = word_at(bits, edge + r - row0, edge + west - col0)
                held = pool[slot, which, r - south]
                pool[slot, which, r - south] = (held & (ALL ^ mask)) | (word & mask)


@kernel
def or_hits(hits: Array3D[np.uint64], tile_row: int, tile_col: int, row0: int, col0: int, out: Bits) -> None:
    """Set the bits of a box that were hit: (rows, columns, TILE) words of tiles from a first one on."""
    for tr in range(hits.shape[0]):
        south = (tile_row + tr) << TILE_BITS
        for tc in range(hits.shape[1]):
            west = ((tile_col + tc) << TILE_BITS) - col0
            for r in range(max(row0, south), min(row0 + len(out), south + TILE)):
                word = hits[tr, tc, r - south]
                if word != NONE:
                    or_word(out, r - row0, west, word)


@kernel
def or_boxes(boxes: Array2D[np.int64], margin: int, row0: int, col0: int, out: Bits) -> None:
    """Set the bits of boxes (n, 4) with a margin, as far as they are in a box of bits."""
    for k in range(len(boxes)):
        west, east = boxes[k, 2] - margin - col0, boxes[k, 3] + margin - col0
        for r in range(max(0, boxes[k, 0] - margin - row0), min(len(out), boxes[k, 1] + margin - row0)):
            for w in range(max(0, west >> 6), min(out.shape[1], ((east - 1) >> 6) + 1)):
                out[r, w] |= word_mask(west - 64 * w, east - 64 * w)


@kernel
def or_points(
    points: ReadOnly2D[np.float64], west: float, south: float, cell: float, row0: int, col0: int, out: Bits
) -> None:
    """Set the bits of the cells of points (n, 3) that are in a box of bits; cells count from a corner."""
    for i in range(len(points)):
        r = int(np.floor((points[i, 1] - south) / cell)) - row0
        c = int(np.floor((points[i, 0] - west) / cell)) - col0
        if 0 <= r < len(out) and 0 <= c < 64 * out.shape[1]:
            out[r, c >> 6] |= ONE << np.uint64(c & 63)


@kernel
def blocks_around(
    points: ReadOnly2D[np.float64], west: float, south: float, cell: float, block: int
) -> Array2D[np.int64]:
    """Return (n, 4) the box of `block` x `block` cells that each point (n, 3) is in."""
    out = np.empty((len(points), 4), np.int64)
    for i in range(len(points)):
        out[i, 0] = block * int(np.floor((points[i, 1] - south) / (block * cell)))
        out[i, 2] = block * int(np.floor((points[i, 0] - west) / (block * cell)))
        out[i, 1], out[i, 3] = out[i, 0] + block, out[i, 2] + block
    return out


@kernel
def regions(boxes: Array2D[np.int64], level: int, margin: int, high: int, most: int) -> Array2D[np.int64]:
    """Return few disjoint boxes (k, 4) of whole patches that cover boxes (n, 4) with a margin.

    Parameters
    ----------
    boxes
        Of finest cells; the result and the margin are in cells of a level, 2^level times as wide.
    high, most
        Rows of a patch, and the longest side of a box.
    """
    wide = np.empty((len(boxes), 4), np.int64)
    hull, n = np.array([LARGEST, -LARGEST, LARGEST, -LARGEST]), 0
    for k in range(len(boxes)):
        if boxes[k, 0] < boxes[k, 1] and boxes[k, 2] < boxes[k, 3]:
            for axis, side in ((0, high), (2, COLS)):
                wide[n, axis] = ((boxes[k, axis] >> level) - margin) // side * side
                wide[n, axis + 1] = -(-(((boxes[k, axis + 1] - 1) >> level) + 1 + margin) // side) * side
                hull[axis] = min(hull[axis], wide[n, axis])
                hull[axis + 1] = max(hull[axis + 1], wide[n, axis + 1])
            n += 1
    if n == 0 or max(hull[1] - hull[0], hull[3] - hull[2]) <= most:
        return hull.copy().reshape(1, 4)[: min(1, n)]
    out, found = np.empty((16, 4), np.int64), 0
    for k in range(n):
        for row in range(wide[k, 0] // most, (wide[k, 1] - 1) // most + 1):
            for col in range(wide[k, 2] // most, (wide[k, 3] - 1) // most + 1):
                north, east = min(wide[k, 1], (row + 1) * most), min(wide[k, 3], (col + 1) * most)
                south, west = max(wide[k, 0], row * most), max(wide[k, 2], col * most)
                at = 0
                while at < found and (out[at, 0] // most != row or out[at, 2] // most != col):
                    at += 1
                if at == found:
                    if found == len(out):
                        out = np.concatenate((out, np.empty_like(out)))
                    out[at, 0], out[at, 1], out[at, 2], out[at, 3] = south, north, west, east
                    found += 1
                out[at, 0], out[at, 1] = min(out[at, 0], south), max(out[at, 1], north)
                out[at, 2], out[at, 3] = min(out[at, 2], west), max(out[at, 3], east)
    return out[:found].copy()


@kernel_part
def _any_in_box(bits: Bits, row0: int, row1: int, col0: int, col1: int) -> bool:
    """Return whether a bit of a box of cells is set."""
    for r in range(row0, row1):
        for c in range(col0, col1, 64):
            if word_at(bits, r, c) & word_mask(0, col1 - c) != NONE:
                return True
    return False


@kernel
def tiles_with_bits(bits: Bits, edge: int, row0: int, row1: int, col0: int, col1: int) -> Array2D[np.int64]:
    """Return rows and columns (n, 2) of the tiles that have a bit set in a box, row by row.

    Parameters
    ----------
    bits, edge
        Bitmap of the box with a margin, which is left out.
    """
    found, n = np.empty((((row1 - row0) // TILE + 2) * ((col1 - col0) // TILE + 2), 2), np.int64), 0
    down, right = edge - row0, edge - col0
    for tr in range(row0 >> TILE_BITS, (row1 - 1 >> TILE_BITS) + 1):
        south, north = max(row0, tr << TILE_BITS), min(row1, (tr + 1) << TILE_BITS)
        for tc in range(col0 >> TILE_BITS, (col1 - 1 >> TILE_BITS) + 1):
            west, east = max(col0, tc << TILE_BITS), min(col1, (tc + 1) << TILE_BITS)
            if _any_in_box(bits, south + down, north + down, west + right, east + right):
                found[n, 0], found[n, 1] = tr, tc
                n += 1
    return found[:n].copy()
