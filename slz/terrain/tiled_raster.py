"""Tiled raster maps of any extent, whose memory follows the ground they cover."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box, common
from slz.kernels.cells.cell_record import TILE
from slz.kernels.cells.tile_boxes import (
    any_in_box,
    copy_bits,
    copy_cells,
    copy_layer,
    put_bits,
    put_layers,
    reach_of,
    set_bits,
)
from slz.kernels.footprint.derive_maps import add_altered, derive_tiles
from slz.kernels.footprint.patch import COLS
from slz.kernels.raster.bitmap import NONE, Bits
from slz.kernels.raster.morphology import dilated
from slz.terrain.demand_zero import demand_zeros, prefault_range
from slz.terrain.derive import CoveredCells
from slz.terrain.terrain_maps import UNKNOWN
from slz.terrain.tiles import SERIALS
from slz.tile_keys import Key, box_of_tile, keys_over, tiles_over

FEWEST_TILES, MOST_TILES = 64, 4096  # tiles of the first block
NO_VERSION = -1  # version of a tile that is not held
KNOWN, COVERED, CLEAR = range(3)  # bitmaps of a tile

Table = NDArray[np.int32]


class Block(NamedTuple):
    """Contiguous tiles from a slot on: (tiles, layers, TILE, TILE) and (tiles, 1, TILE, TILE).

    bits: (tiles, 3, TILE) of the cells that were `KNOWN`, and of the footprints that were `COVERED`
    and `CLEAR` of unseen ground, when they were derived last. levels: (tiles, TILE / 2, TILE / COLS), see
    `slz.kernels.footprint.derive_maps.derive_box`.
    """

    first: int
    layers: NDArray[np.float32]
    states: NDArray[np.uint8]
    bits: NDArray[np.uint64]
    levels: NDArray[np.float32]


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
        table = self._opened(keys_over(box), box)
        for block in self._blocks:
            put_layers(block.layers, block.first, table, box.row0, box.col0, np.ascontiguousarray(layers))
            put_layers(block.states, block.first, table, box.row0, box.col0, np.ascontiguousarray(states))

    def derive(self, box: Box, seen: CoveredCells, changed: Bits) -> tuple[list[Key], int]:
        """Derive the layers and states of those cells of a box that may change, and write them.

        Parameters
        ----------
        box
            Whole patches.
        seen
            Statistics of its cells, with a margin.
        changed
            Those whose statistics may have changed, with the same margin; what has aged is found here.

        Returns
        -------
        Keys of the tiles with derived cells, and the number of these cells.
        """
        edge, near = seen.edge, seen.nearest_unrelated
        around = Box(box.row0 - edge, box.row1 + edge, box.col0 - edge, box.col1 + edge)
        dirty = dilated(changed | (seen.known ^ self._bits(around, KNOWN)), near, around.shape[1])
        add_altered(seen.covered, self._bits(box, COVERED), edge, False, dirty)
        add_altered(seen.unseen, self._bits(box, CLEAR), edge, True, dirty)
        keys = [key for key in keys_over(box) if any_in_box(dirty, *_there(key, box, edge))]
        table, n = self._opened(keys, box), 0
        for block in self._blocks:
            n += derive_tiles(
                seen.cells, seen.covered, seen.unseen, edge, seen.radius, seen.limits, seen.gear.contacts_m,
                seen.gear.limits, block.layers, block.states, block.levels, block.first, table,
                box.row0, box.col0, dirty,
            )  # fmt: skip
            # A cell at the edge, on which footprints outside depend as well, counts as changed once more.
            place = block.first, table, box.row0 + near, box.col0 + near, seen.known, edge + near
            put_bits(block.bits, KNOWN, *place, box.shape[1] - 2 * near)
            for which, bits in ((COVERED, seen.covered), (CLEAR, ~seen.unseen)):
                place = block.first, table, box.row0, box.col0, bits, edge
                put_bits(block.bits, which, *place, box.shape[1])
        return keys, n

    def _bits(self, box: Box, which: int) -> Bits:
        """Return a bitmap of a box as it was when it was derived last."""
        out = np.zeros((box.shape[0], (box.shape[1] + 63) >> 6), np.uint64)
        table = self._table(box)
        for block in self._blocks:
            copy_bits(block.bits, which, block.first, table, box.row0, box.col0, out)
        return out

    def _opened(self, keys: Iterable[Key], box: Box) -> Table:
        """Return the slots of a box's tiles; those of the keys are made, with a new version for a write."""
        self._last, version = None, next(SERIALS)
        for key in keys:
            if key not in self._slot:
                self._make(key)
            self._versions[self._slot[key]] = version
        return self._table(box)

    def read(self, box: Box, layer: int = 0) -> NDArray[np.float32]:
        """Return a copy (rows, cols) of one layer of a box."""
        out = np.empty(box.shape, np.float32)
        table = self._table(box)
        if (table < 0).any():
            out.fill(self._empty[layer])
        for block in self._blocks:
            copy_layer(block.layers, block.first, table, layer, box.row0, box.col0, out)
        return out

    def states(self, box: Box) -> NDArray[np.uint8]:
        """Return a copy (rows, cols) of the states of a box."""
        out = np.empty(box.shape, np.uint8)
        table = self._table(box)
        if (table < 0).any():
            out.fill(UNKNOWN)
        for block in self._blocks:
            copy_layer(block.states, block.first, table, 0, box.row0, box.col0, out)
        return out

    def at(self, cells: NDArray[np.int32], down: int, right: int, layer: int = 0) -> NDArray[np.float32]:
        """Return one layer at (n, 2) rows and columns, shifted down and right."""
        out = np.full(len(cells), self._empty[layer])
        if len(cells):
            row0, row1, col0, col1 = reach_of(cells)
            box = Box(row0 + down, row1 + down, col0 + right, col1 + right)
            table = self._table(box)
            for block in self._blocks:
                copy_cells(
                    block.layers, block.first, table, layer, box.row0, box.col0, cells, down, right, out
                )
        return out

    def bits(self, box: Box, state: np.uint8) -> Bits:
        """Return the bitmap of a state in a box of whole columns of tiles; a word is a row of a tile."""
        out = np.zeros((box.shape[0], box.shape[1] // TILE), np.uint64)
        table = self._table(box)
        for block in self._blocks:
            set_bits(block.states, block.first, table, box.row0, state, out)
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
        block = next(block for block in reversed(self._blocks) if block.first <= self._slot[key])
        block.bits[self._slot[key] - block.first] = NONE

    def _add_block(self) -> None:
        first = len(self._versions)
        size = max(self._expected, first)
        shape: tuple[Any, ...] = (size, len(self._empty), TILE, TILE)
        layers, states = demand_zeros(shape, np.float32), demand_zeros((size, 1, TILE, TILE), np.uint8)
        bits, levels = (
            demand_zeros((size, 3, TILE), np.uint64),
            demand_zeros((size, TILE // 2, TILE // COLS), np.float32),
        )
        self._blocks.append(Block(first, layers, states, bits, levels))
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


def _there(key: Key, box: Box, edge: int) -> tuple[int, int, int, int]:
    """Return row0, row1, col0, col1 of a tile in a bitmap of a box with a margin."""
    own = common(box_of_tile(key), box).relative_to(box).shifted(edge, edge)
    return own.row0, own.row1, own.col0, own.col1
