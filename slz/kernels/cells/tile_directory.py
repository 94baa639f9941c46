"""Directory of tiles: the slot of each by its row and column, an open hash table that kernels read."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D
from slz.kernels.cells.cell_record import TILE_BITS
from slz.kernels.jit import kernel, kernel_part

ROW, COL, SLOT = range(3)  # of an entry; the slot is -1 where there is none
SPREAD = 0x9E3779B1  # apart are the entries of successive rows; those of successive columns are side by side
Directory = Array2D[np.int32]


@kernel_part
def entry_of(directory: Directory, row: int, col: int) -> int:
    """Return the index of a tile's entry, or of the empty one for it."""
    mask = len(directory) - 1
    at = (row * SPREAD + col) & mask
    while directory[at, SLOT] >= 0 and (directory[at, ROW] != row or directory[at, COL] != col):
        at = (at + 1) & mask
    return at


@kernel_part
def slot_at(directory: Directory, row: int, col: int) -> int:
    """Return the slot of a cell's tile, -1 where there is none."""
    return int(directory[entry_of(directory, row >> TILE_BITS, col >> TILE_BITS), SLOT])


@kernel
def enter(directory: Directory, row: int, col: int, slot: int) -> None:
    """Enter a tile; one entry at least must be left empty."""
    at = entry_of(directory, row, col)
    directory[at, ROW], directory[at, COL], directory[at, SLOT] = row, col, slot


@kernel
def remove(directory: Directory, row: int, col: int) -> None:
    """Remove a tile, and move the entries after it to where they are found without it."""
    mask = len(directory) - 1
    gap = entry_of(directory, row, col)
    directory[gap, SLOT] = -1
    at = (gap + 1) & mask
    while directory[at, SLOT] >= 0:
        r, c, slot = directory[at, ROW], directory[at, COL], directory[at, SLOT]
        directory[at, SLOT] = -1
        to = entry_of(directory, r, c)
        directory[to, ROW], directory[to, COL], directory[to, SLOT] = r, c, slot
        at = (at + 1) & mask


@kernel
def slots_over(directory: Directory, row0: int, col0: int, rows: int, cols: int) -> Array2D[np.int32]:
    """Return the slot of every tile of a rectangle of tiles, -1 where there is none."""
    out = np.empty((rows, cols), np.int32)
    for r in range(rows):
        for c in range(cols):
            out[r, c] = directory[entry_of(directory, row0 + r, col0 + c), SLOT]
    return out
