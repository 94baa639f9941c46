"""Snapshots of a map; snapshots of different times share unchanged blocks (copy-on-write)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box

SIDE = 64  # cells of a block
Blocks = NDArray[np.object_]


class BlockCopies:
    """Block copies of a map, each made on the first read after a change.

    Parameters
    ----------
    values
        (blocks, rows, SIDE) the map, cell (r, c) at [c // SIDE, r, c % SIDE].
    """

    def __init__(self, values: NDArray[np.float32]) -> None:
        self._values = values
        shape = -(-values.shape[1] // SIDE), len(values)
        self._blocks: Blocks = np.full(shape, None, object)
        self._copied = np.zeros(shape, bool)

    def change(self, box: Box) -> None:
        """Mark the cells of a box as changed."""
        blocks = _blocks_of(box)
        self._blocks[blocks] = None
        self._copied[blocks] = False

    def of(self, box: Box, wanted: NDArray[np.bool_]) -> Blocks:
        """Return the blocks that cover a box; wanted ones are up to date, others may be old or None."""
        rows, cols = _blocks_of(box)
        missing = (wanted & ~self._copied[rows, cols]).nonzero()
        for down, right in zip(*(index.tolist() for index in missing), strict=True):
            row, col = rows.start + down, cols.start + right
            self._blocks[row, col] = self._values[col, SIDE * row : SIDE * (row + 1)].copy()
        self._copied[rows, cols] |= wanted
        return self._blocks[rows, cols].copy()


def joined(blocks: Blocks, box: Box) -> NDArray[np.float32]:
    """Return the rows of a box, in columns of whole blocks, from the blocks that cover it; NaN elsewhere."""
    first, rows = box.row0 // SIDE * SIDE, box.shape[0]
    out = np.full((SIDE * blocks.shape[0], SIDE * blocks.shape[1]), np.nan, np.float32)
    for (down, right), block in np.ndenumerate(blocks):
        if block is not None:
            out[SIDE * down :, SIDE * right :][: len(block), :SIDE] = block
    return out[box.row0 - first :][:rows]


def heights_at(blocks: Blocks, box: Box, cells: NDArray[np.int32]) -> NDArray[np.float32]:
    """Return the values at (n, 2) rows and columns of the map, from the blocks that cover a box."""
    rows, cols = cells.T
    which = (rows // SIDE - box.row0 // SIDE) * blocks.shape[1] + cols // SIDE - box.col0 // SIDE
    order = np.argsort(which, kind="stable")
    out = np.empty(len(cells), np.float32)
    for part in np.split(order, np.flatnonzero(np.diff(which[order])) + 1):
        out[part] = blocks.flat[which[part[0]]][rows[part] % SIDE, cols[part] % SIDE]
    return out


def _blocks_of(box: Box) -> tuple[slice, slice]:
    return (
        slice(box.row0 // SIDE, (box.row1 - 1) // SIDE + 1),
        slice(box.col0 // SIDE, (box.col1 - 1) // SIDE + 1),
    )
