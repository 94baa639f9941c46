"""Bitmaps of boxes in tiles, against a dense array of the whole plane."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.cells.cell_record import TILE
from slz.kernels.cells.tile_boxes import any_in_box, copy_bits, or_hits, put_bits, set_box
from slz.kernels.raster.bitmap import packed, unpacked

TILES = 3  # to a side


def dense(bits: np.ndarray, cols: int) -> np.ndarray:
    return unpacked(bits, 0, cols) != 0


def table_from(row: int, col: int) -> np.ndarray:
    """The slots of the tiles from that of a cell on."""
    table = np.arange(TILES**2, dtype=np.int32).reshape(TILES, TILES)
    return np.ascontiguousarray(table[row // TILE :, col // TILE :])


@pytest.mark.parametrize("seed", range(8))
def test_bits_written_to_tiles_are_read_from_any_box(seed: int) -> None:
    rng = np.random.default_rng(seed)
    block, whole = np.zeros((TILES**2, 2, TILE), np.uint64), np.zeros((TILES * TILE, TILES * TILE), bool)
    for _ in range(6):
        row0, col0 = rng.integers(0, 2 * TILE, 2)
        rows, cols, edge = rng.integers(1, TILE), rng.integers(1, TILE), rng.integers(0, 9)
        given = rng.random((rows + 2 * edge, cols + 2 * edge)) < 0.4
        put_bits(block, 1, table_from(row0, col0), row0, col0, packed(given.astype(np.uint8)), edge, cols)
        whole[row0 : row0 + rows, col0 : col0 + cols] = given[edge : edge + rows, edge : edge + cols]
        low = rng.integers(0, TILE, 2)
        out = np.zeros((100, 2), np.uint64)
        copy_bits(block, 1, table_from(*low), *low.tolist(), out)
        assert np.array_equal(dense(out, 100), whole[low[0] : low[0] + 100, low[1] : low[1] + 100])
    assert not block[:, 0].any()


@pytest.mark.parametrize(("row0", "col0"), [(0, 0), (-70, 13), (5, -130), (64, 63)])
def test_cells_hit_are_set_in_a_box(row0: int, col0: int) -> None:
    rng = np.random.default_rng(row0 + 200)
    cells = rng.random((2 * TILE, 2 * TILE)) < 0.1  # of tiles from (-1, -1) on
    words = packed(cells.astype(np.uint8)).reshape(2, TILE, 2).transpose(0, 2, 1).copy()
    out = np.zeros((90, 2), np.uint64)
    or_hits(words, -1, -1, row0, col0, out)
    wanted = np.zeros((90, 128), bool)
    for r, c in np.argwhere(cells) - TILE - (row0, col0):
        if 0 <= r < 90 and 0 <= c < 128:
            wanted[r, c] = True
    assert np.array_equal(dense(out, 128), wanted)


@pytest.mark.parametrize(
    "box", [(2, 5, 3, 4), (-9, 40, -70, 200), (0, 30, 60, 70), (7, 7, 1, 9), (4, 8, 64, 128)]
)
def test_a_box_is_set_and_found(box: tuple[int, int, int, int]) -> None:
    out, (row0, row1, col0, col1) = np.zeros((30, 3), np.uint64), box
    set_box(out, *box)
    wanted = np.zeros((30, 192), bool)
    wanted[max(0, row0) : max(0, row1), max(0, col0) : max(0, col1)] = True
    assert np.array_equal(dense(out, 192), wanted)
    assert any_in_box(out, 0, 30, 0, 192) == wanted.any()
    assert any_in_box(out, 5, 9, 65, 70) == wanted[5:9, 65:70].any()
