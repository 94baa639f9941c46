"""Tiled raster maps of any extent, whose memory follows the ground they cover."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box
from slz.kernels.array_memory import demand_zeros, prefault_range
from slz.kernels.cells.cell_record import TILE
from slz.kernels.cells.tile_boxes import (
    copy_bits,
    copy_layer,
    put_bits,
    put_layers,
    set_bits,
    tiles_with_bits,
)
from slz.kernels.cells.tile_directory import Directory
from slz.kernels.footprint.derive_maps import add_altered, derive_tiles
from slz.kernels.footprint.patch import COLS
from slz.kernels.raster.bitmap import NONE, Bits
from slz.kernels.raster.morphology import dilated
from slz.terrain.derive import CoveredCells
from slz.terrain.terrain_maps import UNKNOWN
from slz.terrain.tiles import SERIALS
from slz.tile_slots import Key, TileStore, keys_over

FEWEST_TILES, MOST_TILES = 64, 8192  # slots of the first pools
NO_VERSION = -1  # version of a tile that is not held
KNOWN, COVERED, CLEAR = range(3)  # bitmaps of a tile

Table = NDArray[np.int32]


class Pools(NamedTuple):
    """Contents of the tiles by slot: (slots, layers, TILE, TILE) and (slots, 1, TILE, TILE).

    bits: (slots, 3, TILE) of the cells that were `KNOWN`, and of the footprints that were `COVERED` and
    `CLEAR` of unseen ground, when they were derived last. levels: (slots, TILE / 2, TILE / COLS), see
    `slz.kernels.footprint.derive_maps.derive_box`.
    """

    layers: NDArray[np.float32]
    states: NDArray[np.uint8]
    bits: NDArray[np.uint64]
    levels: NDArray[np.float32]

    @classmethod
    def of(cls, slots: int, n_layers: int) -> Pools:
        """Return empty pools of demand-zero memory."""
        return cls(
            demand_zeros((slots, n_layers, TILE, TILE), np.float32),
            demand_zeros((slots, 1, TILE, TILE), np.uint8),
            demand_zeros((slots, 3, TILE), np.uint64),
            demand_zeros((slots, TILE // 2, TILE // COLS), np.float32),
        )


class TiledLayers:
    """Layers of a map and the states of its cells, in tiles.

    Parameters
    ----------
    empty
        Value of each layer where nothing was written; the state there is unknown.
    expected
        Tiles that fit before all are copied to larger pools.
    """

    def __init__(self, empty: Sequence[float], expected: int = FEWEST_TILES) -> None:
        self._empty = np.array(empty, np.float32)
        self._store = TileStore(min(max(FEWEST_TILES, expected), MOST_TILES))
        self._pools = Pools.of(self._store.capacity, len(empty))
        self._versions = np.full(self._store.capacity, NO_VERSION)

    def __len__(self) -> int:
        return len(self._store)

    def write(self, box: Box, layers: NDArray[np.float32], states: NDArray[np.uint8]) -> None:
        """Write (count, rows, cols) layers of a box, and (1, rows, cols) states."""
        table = self._opened(keys_over(box), box)
        put_layers(self._pools.layers, table, box.row0, box.col0, np.ascontiguousarray(layers))
        put_layers(self._pools.states, table, box.row0, box.col0, np.ascontiguousarray(states))

    def derive(self, box: Box, seen: CoveredCells, changed: Bits) -> tuple[list[Key], int, int]:
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
        Keys of the tiles with derived cells, the number of these, and of those whose state changed.
        """
        edge, near = seen.edge, seen.nearest_unrelated
        around = Box(box.row0 - edge, box.row1 + edge, box.col0 - edge, box.col1 + edge)
        dirty = dilated(changed | (seen.known ^ self._bits(around, KNOWN)), near, around.shape[1])
        add_altered(seen.covered, self._bits(box, COVERED), edge, False, dirty)
        add_altered(seen.unseen, self._bits(box, CLEAR), edge, True, dirty)
        changed_tiles = tiles_with_bits(dirty, edge, box.row0, box.row1, box.col0, box.col1)
        keys = [(row, col) for row, col in changed_tiles.tolist()]
        table, pools = self._opened(keys, box), self._pools
        n, n_changed = derive_tiles(
            seen.cells, seen.covered, seen.unseen, edge, seen.radius, seen.limits, seen.gear.contacts_m,
            seen.gear.limits, pools.layers, pools.states, pools.levels, table, box.row0, box.col0, dirty,
        )  # fmt: skip
        # A cell at the edge, on which footprints outside depend as well, counts as changed once more.
        place, cols = (table, box.row0 + near, box.col0 + near), box.shape[1]
        put_bits(pools.bits, KNOWN, *place, seen.known, edge + near, cols - 2 * near)
        for which, bits in ((COVERED, seen.covered), (CLEAR, ~seen.unseen)):
            put_bits(pools.bits, which, table, box.row0, box.col0, bits, edge, cols)
        return keys, n, n_changed

    def _bits(self, box: Box, which: int) -> Bits:
        """Return a bitmap of a box as it was when it was derived last."""
        out = np.zeros((box.shape[0], (box.shape[1] + 63) >> 6), np.uint64)
        copy_bits(self._pools.bits, which, self._store.table(box), box.row0, box.col0, out)
        return out

    def _opened(self, keys: Iterable[Key], box: Box) -> Table:
        """Return the slots of a box's tiles; those of the keys are made, with a new version for a write."""
        version = next(SERIALS)
        for key in keys:
            if key not in self._store.slot:
                self._make(key)
            self._versions[self._store.slot[key]] = version
        return self._store.table(box)

    def read(self, box: Box, layer: int = 0) -> NDArray[np.float32]:
        """Return a copy (rows, cols) of one layer of a box."""
        out = np.full(box.shape, self._empty[layer])
        copy_layer(self._pools.layers, self._store.table(box), layer, box.row0, box.col0, out)
        return out

    def states(self, box: Box) -> NDArray[np.uint8]:
        """Return a copy (rows, cols) of the states of a box."""
        out = np.full(box.shape, UNKNOWN)
        copy_layer(self._pools.states, self._store.table(box), 0, box.row0, box.col0, out)
        return out

    def bits(self, box: Box, state: np.uint8) -> Bits:
        """Return the bitmap of a state in a box of whole columns of tiles; a word is a row of a tile."""
        out = np.zeros((box.shape[0], box.shape[1] // TILE), np.uint64)
        set_bits(self._pools.states, self._store.table(box), box.row0, state, out)
        return out

    def within(self, box: Box) -> tuple[Table, NDArray[np.int64], Pools]:
        """Return the slots of the tiles that a box touches, -1 for none, their versions, and the pools.

        The version of a tile changes with every write.
        """
        table = self._store.table(box)
        return table, np.where(table < 0, NO_VERSION, self._versions[table]), self._pools

    @property
    def view(self) -> tuple[NDArray[np.float32], NDArray[np.uint8], Directory]:
        """Layers and states by slot, and the directory of slots, for kernels that read."""
        return self._pools.layers, self._pools.states, self._store.directory

    def keep(self, wanted: Callable[[Key], bool]) -> list[Key]:
        """Drop all tiles but those wanted; return the keys of those dropped."""
        gone = [key for key in self._store.slot if not wanted(key)]
        for key in gone:
            self._store.drop(key)
        return gone

    def prepare(self, count: int) -> None:
        """Prefault the memory of `count` more tiles."""
        self._have(count)
        for slot in self._store.next_free(count):
            for held in self._held(slot):
                prefault_range(held[None], slice(0, 1), slice(0, len(held)))

    def keys(self) -> tuple[Key, ...]:
        """Return the keys of all tiles."""
        return tuple(self._store.slot)

    def tile(self, key: Key) -> tuple[NDArray[np.float32], NDArray[np.uint8]] | None:
        """Return layers (count, TILE, TILE) and states (1, TILE, TILE) of a tile, as views.

        None where nothing was written.
        """
        slot = self._store.slot.get(key)
        return None if slot is None else self._held(slot)

    def _held(self, slot: int) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        return self._pools.layers[slot], self._pools.states[slot]

    def _make(self, key: Key) -> None:
        self._have(1)
        slot = self._store.take(key)
        layers, states = self._held(slot)
        layers[:], states[:], self._pools.bits[slot] = self._empty[:, None, None], UNKNOWN, NONE

    def _have(self, count: int) -> None:
        """Have slots for more tiles."""
        store, held = self._store, self._store.capacity
        if store.n_free >= count:
            return
        store.grow_to(max(2 * held, held + count))
        pools = Pools.of(store.capacity, len(self._empty))
        for name in Pools._fields:
            getattr(pools, name)[:held] = getattr(self._pools, name)
        self._pools = pools
        self._versions = np.concatenate([self._versions, np.full(store.capacity - held, NO_VERSION)])
