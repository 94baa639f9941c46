"""Tiles of square maps: their keys, their cells, and their slots in pools."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box
from slz.kernels.cells.cell_record import TILE
from slz.kernels.cells.tile_directory import enter, remove, slots_over

Key = tuple[int, int]
NO_TABLE = np.empty((0, 0), np.int32)


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


class TileStore:
    """Slots of tiles; what they hold is in pools of the user, one record a slot.

    Parameters
    ----------
    capacity
        Number of slots.

    Attributes
    ----------
    slot
        Slot of each tile by its key.
    directory
        The same for kernels, see `slz.kernels.cells.tile_directory`.
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = 0
        self.slot: dict[Key, int] = {}
        self._free: list[int] = []
        self.grow_to(capacity)

    def __len__(self) -> int:
        return len(self.slot)

    @property
    def n_free(self) -> int:
        """Number of slots left."""
        return len(self._free)

    def next_free(self, count: int) -> list[int]:
        """Return up to `count` slots that are given away next."""
        return self._free[max(0, len(self._free) - count) :]

    def grow_to(self, capacity: int) -> None:
        """Add slots; those there are keep their tiles."""
        self._free[:0] = range(self.capacity, capacity)[::-1]
        self.capacity = capacity
        self.directory = np.full((1 << (2 * capacity).bit_length(), 3), -1, np.int32)
        for key, slot in self.slot.items():
            enter(self.directory, *key, slot)

    def take(self, key: Key) -> int:
        """Give a tile a slot; there must be one left."""
        slot = self.slot[key] = self._free.pop()
        enter(self.directory, *key, slot)
        return slot

    def drop(self, key: Key) -> int:
        """Drop a tile; return the slot that it had."""
        slot = self.slot.pop(key)
        self._free.append(slot)
        remove(self.directory, *key)
        return slot

    def table(self, box: Box) -> NDArray[np.int32]:
        """Return the slot of every tile that a box touches, -1 where there is none."""
        if box.empty:
            return NO_TABLE
        (row, col), (rows, cols) = tiles_over(box)
        return slots_over(self.directory, row, col, rows, cols)
