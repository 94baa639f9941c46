"""Islands in holes of a zone: no part of the zone, and without effect on distances."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

import params
from slz.grid import Grid
from slz.kernels.paper.zone_statistics import inside_count
from slz.kernels.raster.bitmap import packed, unpacked
from slz.kernels.raster.distance_transform import square_and_clearance
from slz.kernels.raster.region_fill import all_reach, component
from slz.paper.paper_detection import PaperDetection, Part
from slz.paper.paper_terrain import PaperTerrain
from slz.paper.paper_zone import describe_paper_zone
from tests.oracle.source_rules import distances, largest_square

EIGHT = np.ones((3, 3), int)
NOWHERE = np.full(3, np.nan)
SIDE = 3


def ragged(seed: int) -> NDArray[np.uint8]:
    """Return ground with holes, islands in them and crumbs, coarse or fine; nothing on the margin."""
    rng = np.random.default_rng(seed)
    noise = ndimage.gaussian_filter(rng.normal(size=(70, 190)), rng.choice([0.8, 1.5, 3.0]))
    safe = noise > np.quantile(noise, rng.uniform(0.05, 0.4) if seed % 2 else rng.uniform(0.002, 0.05))
    for _ in range(3):
        row, col, radius = rng.uniform(20, 50), rng.uniform(25, 165), rng.uniform(4, 18)
        safe &= np.abs(np.hypot(*(np.indices(safe.shape) - [[[row]], [[col]]])) - radius) > 1.5
    if seed % 2 == 0:  # a moat all around
        row, col = np.indices(safe.shape)
        edge = np.minimum(np.minimum(row, 69 - row), np.minimum(col, 189 - col))
        safe &= edge // 2 != rng.integers(3, 6)
    safe[[0, -1]], safe[:, [0, -1]] = False, False
    return safe.astype(np.uint8)


def searched(safe: NDArray[np.uint8]) -> tuple[PaperTerrain, PaperDetection, tuple[Part, ...]]:
    terrain = PaperTerrain(Grid(0.0, 0.0, 1.0, *safe.shape), params.load("quadcopter", ["mode=source"]))
    words = packed(safe)
    terrain.safe_bits[:, : words.shape[1]] = words
    terrain.known_bits[:, : words.shape[1]] = words
    terrain.begun[:] = 1
    terrain.changed = terrain.grid.everything
    search = PaperDetection(terrain, SIDE, 12)
    return terrain, search, search.update()


@pytest.mark.parametrize("seed", range(20))
def test_a_cell_reaches_the_contour_if_it_belongs_to_the_component(seed: int) -> None:
    safe = ragged(seed)
    terrain, _, parts = searched(safe)
    label, _ = ndimage.label(safe, EIGHT)
    rng, both = np.random.default_rng(seed), set()
    for part in parts:
        box = part.box
        own = label == label[tuple(part.boundary_cells[0])]
        inside = np.zeros(safe.shape, bool)
        inside[box.slices] = unpacked(part.content, box.col0 & 63, box.shape[1])
        cells = np.argwhere(inside & (safe == 1))
        for row, col in rng.permutation(cells)[:400].tolist():
            at = np.array([[row - box.row0, col - 64 * part.words.start, 0]])
            found = all_reach(terrain.safe_bits, part.content, box.row0, part.words.start, at, 1000)
            assert found == own[row, col]
            both.add(found)
    assert parts
    assert True in both


def test_there_are_islands_among_what_is_tried() -> None:
    with_islands = with_large_ones = 0
    for seed in range(20):
        terrain, _, parts = searched(ragged(seed))
        for part in parts:
            safe = terrain.safe_bits[part.box.row0 : part.box.row1, part.words] & part.content
            first = part.boundary_cells[0] - [part.box.row0, 64 * part.words.start]
            own = component(safe, *first.tolist())
            with_islands += int((safe != own).any())
            cells = (unpacked(bits, 0, 64 * own.shape[1]) == 1 for bits in (own, safe & ~own))
            mine, others = (largest_square(each) if each.any() else 0 for each in cells)
            with_large_ones += int(others > mine)
    assert with_islands > 15
    assert with_large_ones > 2


def test_all_of_several_cells_must_reach_the_contour_and_an_edge_too_long_is_not_followed() -> None:
    safe = np.zeros((30, 70), np.uint8)
    safe[2:28, 2:28] = 1
    safe[8:22, 8:22] = 0
    safe[12:18, 12:18] = 1
    terrain, _, (part,) = searched(safe)

    def reach(cells: list[list[int]], longest: int = 200) -> bool:
        here = np.array(cells) - [part.box.row0, 0]
        return bool(all_reach(terrain.safe_bits, part.content, part.box.row0, 0, here, longest))

    assert reach([[3, 3], [24, 24], [14, 25]])
    assert not reach([[3, 3], [24, 24], [14, 14]])
    assert not reach([[14, 14], [3, 3]])
    assert not reach([[14, 25]], 20)


@pytest.mark.parametrize("seed", range(20))
def test_the_best_point_is_of_the_component_however_large_its_islands(seed: int) -> None:
    safe = ragged(seed)
    terrain, search, parts = searched(safe)
    label, _ = ndimage.label(safe, EIGHT)
    for part in parts:
        zone = describe_paper_zone(
            part, terrain, search, NOWHERE, params.load("quadcopter", ["mode=source"]), 1
        )
        own = label == label[tuple(part.boundary_cells[0])]
        row, col = np.floor(zone.best.enu_m[1::-1]).astype(int)
        away = distances(own)
        assert own[row, col]
        assert zone.best.square_side_m == largest_square(own)
        assert away[row, col] >= away.max() - 0.5
        assert zone.best.clearance_m == pytest.approx(away[row, col] - 0.5)


def test_a_larger_square_on_an_island_is_not_the_zone_s_though_its_farthest_cell_is() -> None:
    safe = np.zeros((70, 120), np.uint8)
    safe[2:68, 2:118] = 1
    safe[5:65, 5:115] = 0
    rows, cols = np.indices(safe.shape)
    safe[np.hypot(rows - 14, cols - 40) < 11.5] = 1  # joined with the ring
    safe[30:49, 70:89] = 1  # an island
    terrain, search, (part,) = searched(safe)
    zone = describe_paper_zone(part, terrain, search, NOWHERE, params.load("quadcopter", ["mode=source"]), 1)
    label, _ = ndimage.label(safe, EIGHT)
    own = label == label[3, 3]
    assert not own[35, 75]
    assert largest_square(own) < 19
    assert distances(own).max() > 11
    assert zone.best.square_side_m == largest_square(own)


@pytest.mark.parametrize("seed", range(8))
def test_where_the_largest_square_is_told_there_is_one(seed: int) -> None:
    safe = ragged(seed)
    square = ndimage.binary_erosion(safe, np.ones((SIDE, SIDE)), origin=-1).astype(np.uint8)
    side, (row, col), _ = square_and_clearance(packed(safe), packed(square), SIDE)
    assert safe[row : row + side, col : col + side].all()
    assert side == largest_square(safe.astype(bool))


@pytest.mark.parametrize("seed", range(12))
def test_cells_of_a_path_are_counted_wherever_the_content_lies(seed: int) -> None:
    rng = np.random.default_rng(seed)
    content = rng.integers(0, 2**63, (int(rng.integers(20, 400)), int(rng.integers(1, 7))), np.uint64)
    steps = rng.integers(-1, 2, (3000, 2)) + (rng.random((3000, 1)) < 0.3) * rng.integers(-1, 2, 2)
    path = np.cumsum(np.clip(steps, -1, 1), axis=0).astype(np.int32)
    row0, col0 = rng.integers(-200, 200), 64 * rng.integers(-3, 3)
    rows, cols = path[:, 0] - row0, path[:, 1] - col0
    held = (rows >= 0) & (cols >= 0) & (rows < len(content)) & (cols < 64 * content.shape[1])
    r, c = rows[held], cols[held].astype(np.uint64)
    inside = int((content[r, (c >> np.uint64(6)).astype(int)] >> (c & np.uint64(63)) & np.uint64(1)).sum())
    outside = len(path) - inside
    for allowed in (outside, outside + 1, len(path)):
        assert inside_count(path, content, row0, col0, allowed) == inside
    assert inside_count(path, content, row0, col0, outside - 1) == -1


@pytest.mark.parametrize("first", range(50, 80))
def test_a_path_straight_out_of_a_content_is_counted_to_its_edge(first: int) -> None:
    """Each way out, whatever the cells are that the box's edge is told by."""
    content = np.full((200, 4), ~np.uint64(0))
    far = np.arange(first, first - 120, -1)
    across = np.full(120, 100)
    for rows, cols in ((far, across), (199 - far, across), (across, far), (across, 255 - far)):
        path = np.column_stack([rows, cols]).astype(np.int32)
        inside = int((far >= 0).sum())
        assert inside_count(path, content, 0, 0, 120 - inside) == inside
        assert inside_count(path, content, 0, 0, 119 - inside) == -1
        back = np.ascontiguousarray(path[::-1])
        assert inside_count(back, content, 0, 0, 120 - inside) == inside


@pytest.mark.parametrize("out", [1, 5, 20])
def test_a_path_that_comes_back_each_time_it_leaves_is_not_taken_for_one_outside(out: int) -> None:
    content = np.full((200, 4), ~np.uint64(0))
    way = np.concatenate([np.arange(31, -1, -1), np.arange(32)]) - 32 + out  # 64 cells, the first outside
    for rows, cols in ((200 + np.tile(way, 6), 100), (-1 - np.tile(way, 6), 100)):
        path = np.column_stack([rows, np.full(len(rows), cols)]).astype(np.int32)
        outside = int(((rows < 0) | (rows >= 200)).sum())
        assert inside_count(path, content, 0, 0, outside) == len(path) - outside
