"""Reuse of a zone's cached tile statistics: the description is the same without it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import params
from slz import Pipeline, Window
from slz.kernels.cells.cell_record import TILE, TILE_BITS
from slz.kernels.raster.bitmap import ALL
from slz.kernels.raster.zonal_sums import ZONAL_STATISTICS, carry_over
from slz.zones.description import Content
from slz.zones.tile_view import TileView
from slz.zones.zone_map import ZoneMap
from tests.unit.slz.hand_made import FRAME, near_map

Points = NDArray[np.float64]
SETTINGS = params.load("quadcopter", ["zone_m=70", "min_boundary_points=5"])


def scan(rng: np.random.Generator, middle: Points, radius: float, blocks: Points) -> Points:
    """Rough ground with blocks on it, seen in a patch about a place."""
    xy = middle + rng.uniform(-radius, radius, (int(80 * radius**2), 2))
    z = 0.1 * np.sin(xy[:, 0] / 5) + rng.normal(0, 0.02, len(xy))
    for east, north, side, height in blocks:
        z[(np.abs(xy[:, 0] - east) < side) & (np.abs(xy[:, 1] - north) < side)] += height
    return np.column_stack([xy, z])


def test_a_part_of_a_zone_in_tiles_of_its_own_is_not_kept_once_it_is_gone() -> None:
    """All tiles that the rest lies in are as they were."""
    pipe = Pipeline(SETTINGS, (0.0, 0.0))
    rng = np.random.default_rng(1)
    points = scan(rng, np.zeros(2), 28, np.empty((0, 4)))
    pipe.process(Window(points, np.zeros(len(points), np.int64), np.array([0.0, 0.0, 20.0]), FRAME, 0, 0))
    near = near_map(pipe)
    assert isinstance(near, ZoneMap)
    whole = max(near.candidates, key=lambda candidate: len(candidate.boundary_cells))
    own, content = whole.own_bits.copy(), whole.content_bits.copy()
    own[:, -1] = content[:, -1] = 0
    rest = replace(whole, own_bits=own, content_bits=content)
    view = TileView.of(near.terrain, near.terrain.seen)
    known = Content.of(rest, near.terrain, Content.of(whole, near.terrain, None, view), view)
    anew = Content.of(rest, near.terrain, None, view)
    assert known.statistics.unchanged
    assert known.candidate is rest
    np.testing.assert_array_equal(known.statistics.totals, anew.statistics.totals)
    np.testing.assert_array_equal(known.statistics.holes, anew.statistics.holes)


@given(st.integers(0, 2**32))
def test_tiles_that_are_as_they_were_are_carried_over_wherever_the_zone_begins(seed: int) -> None:
    """Against one tile after the other, cut out of a wide map; rows beside the old ones are set."""
    rng = np.random.default_rng(seed)
    side = 5 * TILE

    def zone(row0: int, stop: int, word: int, words: int) -> tuple[Any, ...]:
        whole = np.zeros((side, 5), np.uint64)
        whole[row0:stop, word : word + words] = cells[row0:stop, word : word + words]
        return whole, row0, stop, word, words

    cells = rng.integers(0, 2**63, (side, 5), np.uint64) * (rng.random((side, 5)) < rng.choice([0.01, 0.5]))
    ends = np.sort(rng.integers(0, side, 2)), np.sort(rng.integers(0, side, 2))
    if rng.random() < 0.8:
        ends = ends[0], ends[0] + rng.integers(-9, 10, 2)
    words = rng.integers(0, 2, 2)
    (new, row0, stop, word, n), (old, old_row0, old_stop, old_word, old_n) = (
        zone(max(0, int(a)), min(side, int(b) + 1 + max(0, -int(a))), int(w), int(rng.integers(1, 3)))
        for (a, b), w in zip(ends, words, strict=True)
    )
    if rng.random() < 0.3:
        new[rng.integers(row0, stop), word] ^= np.uint64(4)
    versions, old_versions = (rng.random((2, 5, 5)) < 0.1).astype(np.int64)
    sums, all_holes = rng.random((5, 5, ZONAL_STATISTICS)), rng.integers(1, 2**63, (side, 5), np.uint64) & old

    def tiles(first: int, last: int) -> slice:
        return slice(first >> TILE_BITS, ((last - 1) >> TILE_BITS) + 1)

    here = tiles(row0, stop), slice(word, word + n)
    there = tiles(old_row0, old_stop), slice(old_word, old_word + old_n)
    beside = np.full((old_stop - old_row0 + 2 * TILE, old_n), ALL)
    old_holes = beside[TILE : len(beside) - TILE]
    old_holes[:] = all_holes[old_row0:old_stop, there[1]]
    shape = (here[0].stop - here[0].start, n)
    wanted, unchanged, parts, holes = (
        np.ones(shape, bool),
        np.ones(shape, bool),
        np.zeros((*shape, ZONAL_STATISTICS)),
        np.zeros((stop - row0, n), np.uint64),
    )
    mine, theirs = (
        np.ascontiguousarray(x) for x in (new[row0:stop, here[1]], old[old_row0:old_stop, there[1]])
    )
    carry_over(
        row0, np.ascontiguousarray(versions[here]), mine, mine, row0 - old_row0, word - old_word,
        np.ascontiguousarray(old_versions[there]), theirs, theirs, np.ascontiguousarray(sums[there]),
        old_holes, wanted, unchanged, parts, holes,
    )  # fmt: skip
    for i, j in np.ndindex(*shape):
        tr, tc = here[0].start + i, word + j
        rows = slice(tr * TILE, (tr + 1) * TILE)
        known = there[0].start <= tr < there[0].stop and there[1].start <= tc < there[1].stop
        same = known and versions[tr, tc] == old_versions[tr, tc]
        same = same and np.array_equal(new[rows, tc], old[rows, tc])
        assert unchanged[i, j] == same
        assert wanted[i, j] == (new[rows, tc].any() and not same)
        own = slice(max(rows.start, row0), min(rows.stop, stop))
        kept = same and new[rows, tc].any()
        np.testing.assert_array_equal(parts[i, j], sums[tr, tc] if kept else 0)
        found = holes[own.start - row0 : own.stop - row0, j]
        np.testing.assert_array_equal(found, all_holes[own, tc] if kept else 0)


def test_cells_in_other_words_than_rows_of_tiles_are_refused() -> None:
    pipe = Pipeline(SETTINGS, (0.0, 0.0))
    points = scan(np.random.default_rng(1), np.zeros(2), 28, np.empty((0, 4)))
    pipe.process(Window(points, np.zeros(len(points), np.int64), np.array([0.0, 0.0, 20.0]), FRAME, 0, 0))
    near = near_map(pipe)
    assert isinstance(near, ZoneMap)
    one = near.candidates[0]
    aside = replace(one, box=replace(one.box, col0=one.box.col0 + 1, col1=one.box.col1 + 1))
    with pytest.raises(ValueError, match="rows of the terrain's tiles"):
        Content.of(aside, near.terrain, None, TileView.of(near.terrain, near.terrain.seen))
