"""Order of changed tiles: nearest to the vehicle first."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from slz.kernels.cells.cell_record import TILE
from slz.terrain.changes import DISPLAYED, read_changes

CELL_M = 0.5
SIDE_M = TILE * CELL_M
KEYS = {(0, 0), (0, 7), (6, 0), (-3, -4)}


def terrain() -> Any:
    nothing = (list(np.zeros((len(DISPLAYED), TILE, TILE), np.float32)), np.zeros((TILE, TILE), np.uint8))
    return SimpleNamespace(
        changed_tiles=set(KEYS), grid=SimpleNamespace(cell_m=CELL_M), corner_m=(100.0, 200.0), serial=7,
        tile=lambda key, _names: None if key == (-3, -4) else nothing,
    )  # fmt: skip


@pytest.mark.parametrize("nearest", sorted(KEYS - {(-3, -4)}))
def test_the_nearest_tile_comes_first_and_the_others_wait(nearest: tuple[int, int]) -> None:
    maps = terrain()
    row, col = nearest
    around = np.array([100.0 + (col + 0.4) * SIDE_M, 200.0 + (row + 0.6) * SIDE_M, 30.0])
    drawn = read_changes(maps, 1, around)
    assert [tile.key for tile in drawn.tiles] == [nearest]
    assert drawn.left == 3
    assert maps.changed_tiles == KEYS - {nearest}


def test_the_order_is_that_of_the_distance() -> None:
    around = np.array([100.0 + 0.5 * SIDE_M, 200.0 + 0.5 * SIDE_M])
    maps = terrain()
    taken = [read_changes(maps, 1, around) for _ in range(4)]
    assert [[t.key for t in d.tiles] or list(d.gone) for d in taken] == [
        [(0, 0)],
        [(-3, -4)],
        [(6, 0)],
        [(0, 7)],
    ]
    assert not maps.changed_tiles


def test_where_the_vehicle_is_not_known_any_come_first() -> None:
    maps = terrain()
    assert len(read_changes(maps, 2, np.full(3, np.nan)).tiles) in (1, 2)
    assert len(maps.changed_tiles) == 2
