"""Slots of tiles and boxes of cells, against dictionaries of tiles and of cells."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.kernels.cells.cell_record import TILE
from slz.kernels.surface.surface_pool import claim, gather, median_height, read, read_refused, store
from slz.kernels.surface.surface_record import (
    COUNT,
    KIND,
    LAYERS,
    N_LAYERS,
    OBLIQUE,
    RECORD,
    SHAPE,
    SURFACE_FIELDS,
    TIME,
    WATER,
)  # fmt: skip

Tiles, Pool = NDArray[np.float64], NDArray[np.float32]
PLACE = -30.5, 12.25, 0.5
SIDE_M = TILE * PLACE[2]
EVERYWHERE = -1e6, -1e6, 1e6, 1e6
SUSPICION, KINDS = 0.5, np.array([False, False, False, True, False, False])


def empty(capacity: int) -> tuple[Tiles, Pool]:
    tiles = np.tile([0.0, 0.0, -np.inf, 0.0], (capacity, 1))
    return tiles, np.zeros((capacity, TILE, TILE, RECORD), np.float32)


def filled(seed: int) -> tuple[Tiles, Pool]:
    """Return a pool in which three of the tiles around (0, 0) hold anything."""
    (tiles, pool), rng = empty(5), np.random.default_rng(seed)
    for slot, key in enumerate([(0, 0), (-1, 0), (0, 1)]):
        tiles[slot, :3] = *key, 1.0
        pool[slot] = rng.uniform(0, 1, pool[slot].shape)
        pool[slot, ..., LAYERS + KIND] = rng.integers(0, 6, (TILE, TILE))
    return tiles, pool


def cell(tiles: Tiles, pool: Pool, row: int, col: int) -> NDArray[np.float32]:
    """Return the record of a cell, 0 where no tile is."""
    for slot, (r, c, used_s, _) in enumerate(tiles):
        if (r, c) == (row // TILE, col // TILE) and used_s > -np.inf:
            return np.asarray(pool[slot, row % TILE, col % TILE])
    return np.zeros(RECORD, np.float32)


@pytest.mark.parametrize("seed", range(6))
def test_slots_go_to_the_tiles_hit_and_from_those_hit_longest_ago(seed: int) -> None:
    rng, (tiles, pool), used_s = np.random.default_rng(seed), empty(6), dict[tuple[int, ...], float]()
    for now_s in np.repeat(np.arange(20.0), 2):  # some tiles are as old as others
        points = rng.uniform(-3, 3, (rng.integers(1, 6), 3)) * SIDE_M
        near = rng.random(len(points)) < 0.8
        hull, table, row, col, given_up = claim(points, near, EVERYWHERE, PLACE, now_s, tiles, pool)
        keys = np.floor((points[near][:, 1::-1] - (PLACE[1], PLACE[0])) / SIDE_M).astype(int)
        hit, lost = sorted(set(map(tuple, keys.tolist()))), []
        for key in hit:
            others = [other for other in used_s if other not in hit]
            if key in used_s or len(used_s) < len(tiles) or others:
                if key not in used_s and len(used_s) == len(tiles):
                    lost.append(min(others, key=lambda other: (used_s[other], other)))
                    del used_s[lost[-1]]
                used_s[key] = now_s
        assert {(int(r), int(c)): s for r, c, s, _ in tiles if s > -np.inf} == used_s
        west_south = np.array(lost).reshape(-1, 2)[:, ::-1] * SIDE_M + PLACE[:2]
        np.testing.assert_array_equal(given_up, np.hstack([west_south, west_south + SIDE_M]))
        assert len(table) == (np.ptp([r for r, _ in hit]) + 1 if hit else 0)
        if hit:
            assert hull.tolist() == [*points[near].min(axis=0)[:2], *points[near].max(axis=0)[:2]]
            assert (row, col) == tuple(np.min(hit, axis=0))
            held = [(r + row, c + col) in used_s for r, c in np.ndindex(table.shape)]
            assert (table >= 0).ravel().tolist() == held
        tiles[tiles[:, 2] > -np.inf, 3] = 1  # each refuses a cell until it is another's


def test_points_that_are_uncertain_or_beyond_the_edges_claim_nothing() -> None:
    tiles, pool = empty(3)
    points = np.array([[0.0, 0, 0], [500, 0, 0], [np.nan, 0, 0], [0, -np.inf, 0]])
    near = np.array([False, True, True, True])
    _, table, *_ = claim(points, near, (-100.0, -100.0, 100.0, 100.0), PLACE, 1.0, tiles, pool)
    assert not table.size
    assert np.isinf(tiles[:, 2]).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_box_is_read_cell_by_cell_without_what_is_too_old(seed: int) -> None:
    (tiles, pool), rng = filled(seed), np.random.default_rng(seed)
    row, col, (rows, cols) = *rng.integers(-80, 20, 2), rng.integers(1, 90, 2)
    layers, box = np.empty((N_LAYERS, rows, cols), np.float32), np.empty((25, rows, cols), np.float32)
    read(tiles, pool, row, col, LAYERS, layers)
    seen, obliquely, is_outdated = gather(tiles, pool, row, col, 1.0, 0.6, 0.5, box)
    expected = np.array([cell(tiles, pool, row + r, col + c) for r, c in np.ndindex(rows, cols)])
    np.testing.assert_array_equal(layers.reshape(N_LAYERS, -1).T, expected[:, LAYERS : LAYERS + N_LAYERS])
    shape, told_s = expected[:, LAYERS + SHAPE].copy(), expected[:, -1]
    assert is_outdated == ((shape != 0) & (1 - told_s > 0.5)).any()
    expected[1 - expected[:, TIME] > np.float32(0.6), :SURFACE_FIELDS] = 0
    evidence = box[:SURFACE_FIELDS].reshape(SURFACE_FIELDS, -1).T
    np.testing.assert_array_equal(evidence, expected[:, :SURFACE_FIELDS])
    np.testing.assert_array_equal(box[SURFACE_FIELDS].ravel(), np.where(1 - told_s > 0.5, 0, shape))
    assert seen == (expected[:, COUNT] > 0).any()
    assert obliquely == (expected[:, OBLIQUE].sum() > 0.2 * expected[:, COUNT].sum())


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("is_far", [True, False])
def test_a_box_that_is_stored_is_read_again_and_its_changes_are_within_the_edges(
    seed: int, is_far: bool
) -> None:
    (tiles, pool), rng = filled(seed), np.random.default_rng(seed + 10)
    row, col, rows, cols = *rng.integers(-80, 20, 2), *rng.integers(2, 90, 2)
    found = np.empty((N_LAYERS, rows, cols), np.float32)
    read(tiles, pool, row, col, LAYERS, found)
    changed = rng.random((rows, cols)) < 0.001
    found[WATER][changed] = 1 - found[WATER][changed]
    before = pool.copy()
    edges = store(tiles, pool, row, col, PLACE, SUSPICION, KINDS, 5.0, is_far, found)
    again = np.empty_like(found)
    read(tiles, pool, row, col, LAYERS, again)
    for r, c in np.ndindex(rows, cols):
        old, new = cell(tiles, before, row + r, col + c), cell(tiles, pool, row + r, col + c)
        np.testing.assert_array_equal(new[:LAYERS], old[:LAYERS])
        held = np.any([(row + r) // TILE == a and (col + c) // TILE == b for a, b in tiles[:3, :2]])
        assert new[-1] == (5.0 if is_far and held else old[-1])
        np.testing.assert_array_equal(again[:, r, c], found[:, r, c] if held else 0)
        first, then = (x[LAYERS + WATER] > SUSPICION or KINDS[int(x[LAYERS + KIND])] for x in (old, new))
        east, north = PLACE[0] + (col + c + 0.5) * PLACE[2], PLACE[1] + (row + r + 0.5) * PLACE[2]
        if first != then:
            assert any(w < east < e and s < north < n for w, s, e, n in edges)
    was, now = (
        (x[..., LAYERS + WATER] > SUSPICION) | KINDS[x[..., LAYERS + KIND].astype(int)]
        for x in (before, pool)
    )
    np.testing.assert_array_equal(tiles[:3, 3], (now.astype(int) - was).sum(axis=(1, 2))[:3])


@pytest.mark.parametrize("side", [0.3, 0.5, 1.7])
def test_a_raster_is_refused_where_the_cells_at_its_centres_are(side: float) -> None:
    tiles, pool = filled(3)
    out, (west, south) = np.zeros((50, 70), np.bool_), (-40.2, -20.7)
    where = tiles, pool, PLACE, SUSPICION, KINDS, (west, south), side
    assert not read_refused(*where, out)
    tiles[1, 3] = 1
    assert read_refused(*where, out)
    for r, c in np.ndindex(out.shape):
        x, y = west + (c + 0.5) * side, south + (r + 0.5) * side
        at = cell(tiles, pool, int((y - PLACE[1]) // PLACE[2]), int((x - PLACE[0]) // PLACE[2]))
        assert out[r, c] == (at[LAYERS + WATER] > SUSPICION or KINDS[int(at[LAYERS + KIND])])


@pytest.mark.parametrize("n", [1, 2, 9, 10])
@pytest.mark.parametrize("within", [5.0, 0.0])
def test_the_ground_is_the_median_of_the_points_near_a_place_or_else_of_all(n: int, within: float) -> None:
    rng = np.random.default_rng(n)
    points, near = rng.uniform(-8, 8, (40 * n, 3)), rng.random(40 * n) < 0.5
    edges = -7.0, -7.0, 6.0, 7.5
    x, y, z = points[near].T
    inside = (x >= -7) & (x < 6) & (y >= -7) & (y < 7.5)
    foot = inside & (np.hypot(x - 1, y + 2) < within)
    expected = np.median(z[foot if foot.any() else inside])
    assert median_height(points, near, edges, 1.0, -2.0, within) == expected
