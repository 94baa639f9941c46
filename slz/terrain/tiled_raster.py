"""Tiled raster maps of any extent, whose memory follows the ground they cover."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box
from slz.kernels.cells.cell_record import TILE
from slz.kernels.cells.tile_boxes import copy_cells, copy_layer, put_layers, reach_of, set_bits
from slz.kernels.footprint.derive_maps import derive_tiles
from slz.kernels.raster.bitmap import Bits
from slz.terrain.demand_zero import demand_zeros, prefault_range
from slz.terrain.derive import CoveredCells
from slz.terrain.terrain_maps import UNKNOWN
from slz.terrain.tiles import SERIALS
from slz.tile_keys import Key, keys_over, tiles_over

FEWEST_TILES, MOST_TILES = 64, 4096  # tiles of the first block
NO_VERSION = -1  # version of a tile that is not held

Table = NDArray[np.int32]


class Block(NamedTuple):
    """Contiguous tiles from a slot on: (tiles, layers, TILE, TILE) and (tiles, 1, TILE, TILE)."""

    first: int
    layers: NDArray[np.float32]
    states: NDArray[np.uint8]


class TiledLayers:
    """Layers of a map and the states of its cells, in tiles.

    Tiles are in blocks of demand-zero memory; usually there is only one block.

    Parameters
    ----------
    empty
        Value of each layer where nothing was written; the state there is unknown.
    expected
        Tiles that fit in the first block.
    """

    def __init__(self, empty: Sequence[float], expected: int = FEWEST_TILES) -> None:
        self._empty = np.array(empty, np.float32)
        self._expected = min(max(FEWEST_TILES, expected), MOST_TILES)
        self._blocks: list[Block] = []
        self._versions = np.empty(0, np.int64)
        self._slot: dict[Key, int] = {}
        self._free: list[int] = []
        self._last: tuple[Key, Table] | None = None  # first tile and table of the last lookup of `_table`

    def __len__(self) -> int:
        return len(self._slot)

    def write(self, box: Box, layers: NDArray[np.float32], states: NDArray[np.uint8]) -> None:
        """Write (count, rows, cols) layers of a box, and (1, rows, cols) states."""
        table = self._opened(box)
        for first, held, held_states in self._blocks:
            put_layers(held, first, table, box.row0, box.col0, np.ascontiguousarray(layers))
            put_layers(held_states, first, table, box.row0, box.col0, np.ascontiguousarray(states))

    def derive(self, box: Box, seen: CoveredCells) -> None:
        """Derive the layers and states of a box and write them, see `slz.terrain.derive.derive`."""
        table = self._opened(box)
        for first, held, states in self._blocks:
            derive_tiles(
                seen.cells, seen.covered, seen.unseen, seen.edge, seen.radius, seen.limits,
                seen.gear.contacts_m, seen.gear.limits, held, states, first, table, box.row0, box.col0,
            )  # fmt: skip

    def _opened(self, box: Box) -> Table:
        """Return the slots of the tiles of a box, made where missing, with a new version for the write."""
        self._last = None
        for key in keys_over(box):
            if key not in self._slot:
                self._make(key)
        table = self._table(box)
        self._versions[table.ravel()] = next(SERIALS)
        return table

    def read(self, box: Box, layer: int = 0) -> NDArray[np.float32]:
        """Return a copy (rows, cols) of one layer of a box."""
        out = np.empty(box.shape, np.float32)
        table = self._table(box)
        if (table < 0).any():
            out.fill(self._empty[layer])
        for first, held, _ in self._blocks:
            copy_layer(held, first, table, layer, box.row0, box.col0, out)
        return out

    def states(self, box: Box) -> NDArray[np.uint8]:
        """Return a copy (rows, cols) of the states of a box."""
        out = np.empty(box.shape, np.uint8)
        table = self._table(box)
        if (table < 0).any():
            out.fill(UNKNOWN)
        for first, _, held in self._blocks:
            copy_layer(held, first, table, 0, box.row0, box.col0, out)
        return out

    def at(self, cells: NDArray[np.int32], down: int, right: int, layer: int = 0) -> NDArray[np.float32]:
        """Return one layer at (n, 2) rows and columns, shifted down and right."""
        out = np.full(len(cells), self._empty[layer])
        if len(cells):
            row0, row1, col0, col1 = reach_of(cells)
            box = Box(row0 + down, row1 + down, col0 + right, col1 + right)
            table = self._table(box)
            for first, held, _ in self._blocks:
                copy_cells(held, first, table, layer, box.row0, box.col0, cells, down, right, out)
        return out

    def bits(self, box: Box, state: np.uint8) -> Bits:
        """Return the bitmap of a state in a box of whole columns of tiles; a word is a row of a tile."""
        out = np.zeros((box.shape[0], box.shape[1] // TILE), np.uint64)
        table = self._table(box)
        for first, _, held in self._blocks:
            set_bits(held, first, table, box.row0, state, out)
        return out

    def within(self, box: Box) -> tuple[Table, NDArray[np.int64], Iterator[Block]]:
        """Return the slots of the tiles that a box touches, -1 for none, their versions, and the blocks.

        The version of a tile changes with every write.
        """
        table = self._table(box)
        versions = np.where(table < 0, NO_VERSION, self._versions[table]) if self._blocks else table
        return table, np.asarray(versions, np.int64), iter(self._blocks)

    def keep(self, wanted: Callable[[Key], bool]) -> list[Key]:
        """Drop all tiles but those wanted; return the keys of those dropped."""
        self._last = None
        gone = [key for key in self._slot if not wanted(key)]
        self._free.extend(self._slot.pop(key) for key in gone)
        return gone

    def prepare(self, count: int) -> None:
        """Prefault the memory of `count` more tiles."""
        while len(self._free) < count:
            self._add_block()
        for slot in self._free[len(self._free) - count :]:
            for held in self._held(slot):
                prefault_range(held[None], slice(0, 1), slice(0, len(held)))

    def keys(self) -> tuple[Key, ...]:
        """Return the keys of all tiles."""
        return tuple(self._slot)

    def tile(self, key: Key) -> tuple[NDArray[np.float32], NDArray[np.uint8]] | None:
        """Return layers (count, TILE, TILE) and states (1, TILE, TILE) of a tile, as views.

        None where nothing was written.
        """
        slot = self._slot.get(key)
        return None if slot is None else self._held(slot)

    def _held(self, slot: int) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        block = next(block for block in reversed(self._blocks) if block.first <= slot)
        return block.layers[slot - block.first], block.states[slot - block.first]

    def _make(self, key: Key) -> None:
        if not self._free:
            self._add_block()
        self._slot[key] = self._free.pop()
        layers, states = self._held(self._slot[key])
        layers[:], states[:] = self._empty[:, None, None], UNKNOWN

    def _add_block(self) -> None:
        first = len(self._versions)
        size = max(self._expected, first)
        shape: tuple[Any, ...] = (size, len(self._empty), TILE, TILE)
        layers, states = demand_zeros(shape, np.float32), demand_zeros((size, 1, TILE, TILE), np.uint8)
        self._blocks.append(Block(first, layers, states))
        self._versions = np.concatenate([self._versions, np.full(size, NO_VERSION)])
        self._free[:0] = range(first, first + size)[::-1]

    def _table(self, box: Box) -> Table:
        """Return the slot of every tile that a box touches, -1 where there is none.

        The last lookup is cached. Two threads may read concurrently while none writes.
        """
        if box.empty:
            return np.empty((0, 0), np.int32)
        (row, col), (rows, cols) = tiles_over(box)
        if self._last is not None:
            (south, west), table = self._last
            part = table[row - south : row - south + rows, col - west : col - west + cols]
            if row >= south and col >= west and part.shape == (rows, cols):
                return np.ascontiguousarray(part)
        get = self._slot.get
        slots = [get((r, c), -1) for r in range(row, row + rows) for c in range(col, col + cols)]
        table = np.array(slots, np.int32).reshape(rows, cols)
        self._last = (row, col), table
        return table
