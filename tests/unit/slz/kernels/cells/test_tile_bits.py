"""Bitmaps of boxes in tiles, against a dense array of the whole plane."""

from __future__ import annotations

import numpy as np
import pytest

from slz.kernels.cells.cell_record import TILE
from slz.kernels.cells.tile_boxes import (
    blocks_around,
    copy_bits,
    or_boxes,
    or_hits,
    or_points,
    put_bits,
    regions,
    tiles_with_bits,
)
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


@pytest.mark.parametrize("box", [(2, 5, 3, 4), (-9, 40, -70, 200), (0, 30, 60, 70), (4, 8, 64, 128)])
def test_a_box_is_set_and_found(box: tuple[int, int, int, int]) -> None:
    out, (row0, row1, col0, col1) = np.zeros((30, 3), np.uint64), box
    or_boxes(np.array([[row0 + 3, row1 + 1, col0 - 5, col1 - 7]]), 1, 2, -6, out)
    wanted = np.zeros((30, 192), bool)
    wanted[max(0, row0) : max(0, row1), max(0, col0) : max(0, col1)] = True
    assert np.array_equal(dense(out, 192), wanted)


@pytest.mark.parametrize(("row0", "col0", "edge"), [(0, 0, 0), (-70, -3, 2), (60, 63, 1), (-64, 128, 3)])
def test_tiles_with_a_bit_in_a_box_are_found_row_by_row(row0: int, col0: int, edge: int) -> None:
    rng = np.random.default_rng(row0 + 100)
    cells = rng.random((150 + 2 * edge, 190 + 2 * edge)) < 2e-4
    cells[: edge + 1, : edge + 1] = True  # of the margin, and the box's corner
    wanted = {
        ((r + row0) // TILE, (c + col0) // TILE)
        for r, c in np.argwhere(cells[edge : edge + 150, edge : edge + 190])
    }
    found = tiles_with_bits(packed(cells.astype(np.uint8)), edge, row0, row0 + 150, col0, col0 + 190)
    assert [tuple(key) for key in found.tolist()] == sorted(wanted)


def test_points_set_their_cells_and_are_in_their_blocks() -> None:
    rng = np.random.default_rng(4)
    points = rng.uniform(-20, 20, (300, 3))
    out, wanted = np.zeros((60, 2), np.uint64), np.zeros((60, 128), bool)
    or_points(points, 1.0, -2.0, 0.25, -30, -40, out)
    rows, cols = (
        np.floor((points[:, 1] + 2) / 0.25).astype(int),
        np.floor((points[:, 0] - 1) / 0.25).astype(int),
    )
    inside = (rows >= -30) & (rows < 30) & (cols >= -40) & (cols < 88)
    wanted[rows[inside] + 30, cols[inside] + 40] = True
    assert np.array_equal(dense(out, 128), wanted)
    blocks = blocks_around(points, 1.0, -2.0, 0.25, 16)
    assert (blocks[:, ::2] % 16 == 0).all()
    assert (blocks[:, 1::2] - blocks[:, ::2] == 16).all()
    assert (
        (blocks[:, 0] <= rows) & (rows < blocks[:, 1]) & (blocks[:, 2] <= cols) & (cols < blocks[:, 3])
    ).all()


@pytest.mark.parametrize("level", [0, 2])
@pytest.mark.parametrize("spread", [100, 3000])
def test_regions_cover_boxes_with_their_margin_and_are_disjoint_whole_patches(
    level: int, spread: int
) -> None:
    rng = np.random.default_rng(spread + level)
    low = rng.integers(-spread, spread, (12, 2))
    high = low + rng.integers(0, 40, (12, 2))
    boxes = np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)
    found = regions(boxes, level, 5, 8, 512)
    assert (len(found) == 1) == (spread >> level <= 200)
    count: dict[tuple[int, int], int] = {}
    for row0, row1, col0, col1 in found.tolist():
        assert row0 % 8 == row1 % 8 == col0 % 32 == col1 % 32 == 0
        assert max(row1 - row0, col1 - col0) <= 512
        for corner in ((row0, col0), (row0, col1 - 1), (row1 - 1, col0), (row1 - 1, col1 - 1)):
            count[corner] = sum(
                r0 <= corner[0] < r1 and c0 <= corner[1] < c1 for r0, r1, c0, c1 in found.tolist()
            )
    assert set(count.values()) == {1}
    for row0, row1, col0, col1 in boxes[(boxes[:, 0] < boxes[:, 1]) & (boxes[:, 2] < boxes[:, 3])].tolist():
        for r in ((row0 >> level) - 5, ((row1 - 1) >> level) + 5):
            for c in ((col0 >> level) - 5, ((col1 - 1) >> level) + 5):
                assert any(r0 <= r < r1 and c0 <= c < c1 for r0, r1, c0, c1 in found.tolist())


def test_no_boxes_need_no_region() -> None:
    assert len(regions(np.array([[3, 3, 0, 9]]), 0, 5, 8, 512)) == 0
