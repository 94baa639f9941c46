"""Obstacles and sure ground of a zone, from the tiles of a map, against plain arrays of the same cells."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from slz.kernels.raster.bitmap import packed
from slz.kernels.raster.distance_transform import greatest_clearance
from slz.kernels.raster.zone_views import heights_at, sure_clearance, zone_obstacles
from tests.oracle.source_rules import largest_square

TILES, SIDE = (3, 3), 192
PLACES = 2, 0, 1, 3  # of heights, tops, slopes and certainties among the layers
CORNER = -70, 64 * 5 - 9  # row and column of the grid at the corner of the table
SQUARE = np.ones((3, 3))
CERTAINTIES = np.array([0.9, 0.7, 0.5], np.float32)
NONE = np.empty((0, 6), np.int64), np.empty(0)
Map = NDArray[np.float32]


def tiles(maps: Map) -> tuple[Any, ...]:
    """The layers (4, SIDE, SIDE) in tiles of any order; a tile that is unknown all over is not held."""
    rng, layers = np.random.default_rng(1), np.zeros((12, 4, 64, 64), np.float32)
    table = rng.permutation(12)[:9].reshape(TILES).astype(np.int32)
    for i, j in np.ndindex(*TILES):
        tile = maps[:, 64 * i : 64 * i + 64, 64 * j : 64 * j + 64]
        layers[table[i, j]] = tile
        if np.isnan(tile).all():
            table[i, j] = -1
    return layers, table, *CORNER, PLACES


def blobs(rng: np.random.Generator, smooth: float, share: float) -> NDArray[np.bool_]:
    rough = ndimage.gaussian_filter(rng.normal(size=(SIDE, SIDE)), smooth)
    return np.asarray(rough > np.quantile(rough, 1 - share))


def world(seed: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Map]:
    """A zone, holes in it, and layers: heights with gaps, tops with more, slopes, certainties."""
    rng = np.random.default_rng(seed)
    own, holes = blobs(rng, 9, 0.5), blobs(rng, 1.5, 0.1)
    maps = rng.normal(0, 1, (4, SIDE, SIDE)).astype(np.float32)
    maps[0][rng.random((SIDE, SIDE)) < 0.5] = maps[2][rng.random((SIDE, SIDE)) < 0.2] = np.nan
    maps[1][rng.random((SIDE, SIDE)) < 0.1] = np.nan
    maps[3] = np.clip(ndimage.gaussian_filter(rng.normal(size=(SIDE, SIDE)), 4) * 9 + 0.8, 0, 1)
    maps[:, 64:128, 128:] = np.nan
    own[64:128, 128:] = False
    return own & ~holes, holes, maps


def bits(cells: NDArray[np.bool_]) -> NDArray[np.uint64]:
    return packed(cells.view(np.uint8))


@pytest.mark.parametrize("seed", range(12))
def test_obstacles_are_the_largest_groups_over_the_ground_around_them(seed: int) -> None:
    own, holes, maps = world(seed)
    top, height = np.where(np.isnan(maps[0]), maps[2], maps[0]), maps[2]
    first, most, around = int(np.random.default_rng(seed).integers(0, 70)), 6, 3
    found = zone_obstacles(
        *tiles(maps), CORNER[0] + first, CORNER[1], bits(own[first:]), bits(holes[first:]), most, around,
        np.zeros((0, 0), bool), *NONE,
    )  # fmt: skip
    groups, cells, highest, tops, grounds = found
    label, n = ndimage.label(holes[first:], SQUARE)
    sizes = ndimage.sum_labels(holes[first:], label, range(1, n + 1))
    largest = np.sort(np.argsort(-sizes, kind="stable")[:most]) + 1
    assert len(groups) == len(largest)
    for g, which in enumerate(largest.tolist()):
        mine = np.argwhere(label == which) + np.array([first, 0])
        np.testing.assert_array_equal(cells[groups[g, 4] : groups[g, 5]] - CORNER, mine)
        (r0, c0), (r1, c1) = mine.min(axis=0), mine.max(axis=0) + 1
        assert groups[g, :4].tolist() == (np.array([r0, r1, c0, c1]) + np.repeat(CORNER, 2)).tolist()
        near = np.zeros_like(own)
        near[max(first, r0 - around) : r1 + around, max(0, c0 - around) : c1 + around] = True
        ground = height[near & own & np.isfinite(height)]
        np.testing.assert_equal(grounds[g], np.median(ground) if len(ground) else np.nan)
        up = top[tuple(mine.T)]
        assert tops[g] == np.nanmax(up, initial=-np.inf)
        if np.isfinite(tops[g]):
            assert highest[g] == groups[g, 4] + np.flatnonzero(up == tops[g])[0]


@pytest.mark.parametrize("seed", range(12))
def test_grounds_of_unchanged_tiles_are_those_of_before(seed: int) -> None:
    """The map, the zone and its holes change in some tiles, and the zone begins at another row."""
    own, holes, maps = world(seed)
    later_own, later_holes, later_maps = world(seed + 100)
    same = np.random.default_rng(seed).random(TILES) < 0.8
    kept = np.kron(same, np.ones((64, 64), bool)).astype(bool)
    now_own, now_holes = np.where(kept, own, later_own), np.where(kept, holes, later_holes)
    now = np.where(kept, maps, later_maps)

    def found(first: int, view: Any, a: NDArray[np.bool_], b: NDArray[np.bool_], *known: Any) -> Any:
        where = CORNER[0] + first, CORNER[1]
        return zone_obstacles(*tiles(view), *where, bits(a[first:]), bits(b[first:]), 200, 3, *known)

    before = found(3, maps, own, holes, np.zeros((0, 0), bool), *NONE)
    same[0] = False  # whose first rows are left out
    mine = found(5, now, now_own, now_holes, same, before[0], before[4])
    anew = found(5, now, now_own, now_holes, np.zeros((0, 0), bool), *NONE)
    for one, other in zip(mine, anew, strict=True):
        np.testing.assert_array_equal(one, other)
    if same.any():  # else it says nothing: they are not looked up again
        wrong = found(5, now, now_own, now_holes, same, before[0], before[4] + 1)
        assert (wrong[4] != anew[4])[np.isfinite(anew[4])].any()


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("side", [2, 5, 9, 40])
def test_the_clearest_cells_are_amid_the_surest_ground(seed: int, side: int) -> None:
    own, _, maps = world(seed)
    edt = ndimage.distance_transform_edt
    slope, sure, height = maps[1], np.nan_to_num(maps[3], nan=0.0), maps[2]

    def clearest(cells: NDArray[np.bool_]) -> NDArray[np.int64]:
        away = edt(np.pad(cells, 1))[1:-1, 1:-1]
        return np.argwhere(away >= away.max() - 0.5)

    square = largest_square(own)
    wanted = clearest(own)
    corner = wanted - (side - 1) // 2
    undoubted = own & (sure >= CERTAINTIES[0])
    amid = [
        min(r, c) >= 0 and max(r, c) + side <= SIDE and undoubted[r : r + side, c : c + side].all()
        for r, c in corner.tolist()
    ]
    if any(amid):
        wanted = wanted[amid]
    else:
        for least in CERTAINTIES:
            ground = own & (sure >= least)
            if largest_square(ground) >= side:
                wanted = clearest(ground)
                break
    farthest = greatest_clearance(bits(own), square, np.empty((0, 3), np.int64))
    cell_m, error_m = 0.5, 1.2
    grid = 100.0, -20.0, cell_m
    cells, distance2, ground_there = sure_clearance(
        *tiles(maps), *CORNER, bits(own), farthest, square, side, CERTAINTIES, grid, error_m
    )
    np.testing.assert_array_equal(cells - CORNER, wanted)
    r, c = wanted.T
    np.testing.assert_array_equal(distance2, np.rint(edt(np.pad(own, 1))[1:-1, 1:-1][r, c] ** 2))
    np.testing.assert_array_equal(ground_there[0], np.where(np.isnan(slope[r, c]), 90, slope[r, c]))
    np.testing.assert_array_equal(ground_there[1], sure[r, c])
    np.testing.assert_array_equal(ground_there[3], height[r, c])
    wide = np.pad(sure, 3)
    least_there = [wide[i + 1 : i + 6, j + 1 : j + 6].min() for i, j in wanted]
    np.testing.assert_array_equal(ground_there[2], least_there)
    np.testing.assert_array_equal(heights_at(*tiles(maps), cells.astype(np.int32)), height[r, c])
