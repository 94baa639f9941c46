"""Store of tiles: the directory that kernels read says what the dictionary says."""

from __future__ import annotations

import numpy as np
import pytest

from slz.grid import Box
from slz.kernels.cells.cell_record import TILE
from slz.tile_slots import TileStore

AROUND = Box(-9 * TILE, 9 * TILE, -9 * TILE, 9 * TILE)


def told(store: TileStore) -> dict[tuple[int, int], int]:
    table = store.table(AROUND)
    return {(r - 9, c - 9): int(table[r, c]) for r, c in np.argwhere(table >= 0).tolist()}


@pytest.mark.parametrize("seed", range(4))
def test_tiles_come_and_go_and_each_keeps_its_slot(seed: int) -> None:
    rng, store = np.random.default_rng(seed), TileStore(8)
    for _ in range(600):
        key = (int(rng.integers(-9, 9)), int(rng.integers(-9, 9)))
        if key in store.slot:
            slot = store.slot[key]
            assert store.drop(key) == slot
        else:
            if not store.n_free:
                store.grow_to(2 * store.capacity)
            assert store.take(key) in range(store.capacity)
        assert told(store) == store.slot
        assert len(set(store.slot.values())) == len(store) == store.capacity - store.n_free


def test_tiles_anywhere_are_found() -> None:
    store = TileStore(64)
    keys = [(row, col) for row in (-(2**31), -1, 0, 2**31 - 1) for col in (-(2**31), -7, 3, 2**31 - 1)]
    for key in keys:
        store.take(key)
    for row, col in keys[5:11]:
        box = Box(row * TILE, row * TILE + 1, col * TILE, col * TILE + 1)
        assert store.table(box).tolist() == [[store.slot[row, col]]]


def test_an_empty_box_touches_no_tile() -> None:
    assert TileStore(1).table(Box(0, 0, 0, 0)).size == 0
