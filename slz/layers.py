"""Maps of any extent in tiles: memory follows the ground they are drawn over."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from slz.grid import Box
from slz.kernels.record import TILE
from slz.kernels.tiled import copy_cells, copy_layer, put_layers, reach_of
from slz.tiles import Key, keys_over, tiles_over
from slz.untouched import make_ready, untouched

FEWEST = 64  # tiles of the first block


class TiledLayers:
    """Layers of a map in tiles, as many as `empty` has values, which stand where nothing was written.

    Tiles lie in blocks, each as long as all before it together, whose memory is taken where tiles are made.
    """

    def __init__(self, empty: Sequence[float], dtype: DTypeLike) -> None:
        self._empty = np.array(empty, dtype)
        self._blocks: list[tuple[int, NDArray[Any]]] = []  # the first slot of each
        self._slot: dict[Key, int] = {}
        self._free: list[int] = []
        self._last: tuple[Box, NDArray[np.int32], bool] | None = None  # `_table` of the box read last

    def write(self, box: Box, values: NDArray[Any]) -> None:
        """Set (count, rows, cols) values of a box."""
        self._last = None
        for key in keys_over(box):
            if key not in self._slot:
                self._make(key)
        (table, _), given = self._table(box), np.ascontiguousarray(values, self._empty.dtype)
        for first, block in self._blocks:
            put_layers(block, first, table, box.row0, box.col0, given)

    def read(self, box: Box, layer: int = 0) -> NDArray[Any]:
        """Return a copy (rows, cols) of one layer of a box."""
        out = np.empty(box.shape, self._empty.dtype)
        if box.empty:
            return out
        last = self._last  # two threads may read, while none writes
        if last is None or last[0] != box:
            last = self._last = box, *self._table(box)
        _, table, whole = last
        if not whole:
            out.fill(self._empty[layer])
        for first, block in self._blocks:
            copy_layer(block, first, table, layer, box.row0, box.col0, out)
        return out

    def at(self, cells: NDArray[np.int32], down: int, right: int, layer: int = 0) -> NDArray[Any]:
        """Return one layer of (n, 2) rows and columns, once they are moved down and right."""
        out = np.full(len(cells), self._empty[layer])
        if len(cells):
            row0, row1, col0, col1 = reach_of(cells)
            box = Box(row0 + down, row1 + down, col0 + right, col1 + right)
            table, _ = self._table(box)
            for first, block in self._blocks:
                copy_cells(block, first, table, layer, box.row0, box.col0, cells, down, right, out)
        return out

    def keep(self, wanted: Callable[[Key], bool]) -> list[Key]:
        """Forget all tiles but those wanted; return which."""
        self._last = None
        gone = [key for key in self._slot if not wanted(key)]
        self._free.extend(self._slot.pop(key) for key in gone)
        return gone

    def prepare(self, count: int) -> None:
        """Have memory ready for so many more tiles."""
        while len(self._free) < count:
            self._add_block()
        for slot in self._free[len(self._free) - count :]:
            make_ready(self._held(slot)[None], slice(0, 1), slice(0, len(self._empty)))

    def keys(self) -> tuple[Key, ...]:
        """Return the keys of all tiles."""
        return tuple(self._slot)

    def tile(self, key: Key) -> NDArray[Any] | None:
        """Return a tile (count, TILE, TILE) as it is held, not a copy; None where nothing was written."""
        slot = self._slot.get(key)
        return None if slot is None else self._held(slot)

    def _held(self, slot: int) -> NDArray[Any]:
        first, block = next(pair for pair in reversed(self._blocks) if pair[0] <= slot)
        tile: NDArray[Any] = block[slot - first]
        return tile

    def _make(self, key: Key) -> None:
        if not self._free:
            self._add_block()
        self._slot[key] = self._free.pop()
        self._held(self._slot[key])[:] = self._empty[:, None, None]

    def _add_block(self) -> None:
        first = sum(len(block) for _, block in self._blocks)
        size = max(FEWEST, first)
        self._blocks.append((first, untouched((size, len(self._empty), TILE, TILE), self._empty.dtype)))
        self._free[:0] = range(first, first + size)[::-1]

    def _table(self, box: Box) -> tuple[NDArray[np.int32], bool]:
        """Return the slot of every tile that a box touches, -1 where there is none, and whether all are."""
        (row, col), (rows, cols) = tiles_over(box)
        get = self._slot.get
        slots = [get((r, c), -1) for r in range(row, row + rows) for c in range(col, col + cols)]
        return np.array(slots, np.int32).reshape(rows, cols), -1 not in slots
