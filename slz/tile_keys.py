"""Tiles of square maps: their keys, and the cells that they hold."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box
from slz.kernels.cells.cell_record import TILE

Key = tuple[int, int]


def keys_over(box: Box) -> tuple[Key, ...]:
    """Return the keys of the tiles that a box of cells touches."""
    if box.empty:
        return ()
    (row, col), (rows, cols) = tiles_over(box)
    return tuple(itertools.product(range(row, row + rows), range(col, col + cols)))


def box_of_tile(key: Key) -> Box:
    """Return the cells of a tile."""
    return Box(key[0] * TILE, (key[0] + 1) * TILE, key[1] * TILE, (key[1] + 1) * TILE)


def boxes_of_tiles(keys: Iterable[Key]) -> NDArray[np.int64]:
    """Return (n, 4) row0, row1, col0, col1 (half open) of the cells of tiles."""
    row, col = np.array([*keys], np.int64).reshape(-1, 2).T * TILE
    return np.stack([row, row + TILE, col, col + TILE], axis=1)


def tiles_over(box: Box) -> tuple[Key, tuple[int, int]]:
    """Return the first tile of a box, and the number of rows and columns of tiles."""
    row, col = box.row0 // TILE, box.col0 // TILE
    return (row, col), ((box.row1 - 1) // TILE - row + 1, (box.col1 - 1) // TILE - col + 1)
