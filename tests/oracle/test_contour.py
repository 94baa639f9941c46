"""Contours, squares and components against a slow tracer, brute force and scipy.ndimage on random maps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

import params
from slz.grid import Box, Grid
from slz.kernels.polygons.boundary_tracing import squares
from slz.kernels.raster.bitmap import packed, unpacked
from slz.kernels.raster.connected_components import components, put_without_small_parts
from slz.kernels.raster.distance_transform import largest_square
from slz.kernels.raster.morphology import erode_to_side
from slz.kernels.raster.region_fill import component
from slz.paper.paper_detection import PaperDetection
from slz.paper.paper_terrain import PaperTerrain
from slz.zones.detection import LEAST_TRACE, Candidate, search_components
from tests.oracle.source_rules import moore

Map = NDArray[np.uint8]
EIGHT = np.ones((3, 3))


@st.composite
def maps(draw: st.DrawFn) -> Map:
    """Random map with an unsafe margin: noise, or blobs with holes and islands in them."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    rows, cols = draw(st.integers(3, 26)), draw(st.integers(3, 26))
    noise = rng.random((rows, cols))
    if draw(st.booleans()):
        noise = ndimage.gaussian_filter(noise, 1.2)
    safe = noise > np.quantile(noise, draw(st.sampled_from([0.15, 0.4, 0.6, 0.85])))
    return np.pad(safe, 1).astype(np.uint8)


def ring_with_islands() -> Map:
    """A closed ring, a block within it, a ring within that, and a block outside."""
    safe = np.zeros((30, 44), np.uint8)
    safe[2:28, 2:28] = 1
    safe[5:25, 5:25] = 0
    safe[8:22, 8:22] = 1
    safe[11:19, 11:19] = 0
    safe[13:17, 13:17] = 1
    safe[5:12, 33:41] = 1
    return safe


def first_cells(label: NDArray[np.int32], count: int) -> list[tuple[int, int]]:
    found = []
    for number in range(1, count + 1):
        row, col = np.argwhere(label == number)[0]
        found.append((int(row), int(col)))
    return found


def test_the_tracing_of_a_long_contour_is_complete() -> None:
    """A comb, whose contour is longer than the tracer's first room."""
    safe = np.zeros((40, 203), np.uint8)
    safe[1:3, 1:-1] = 1
    safe[3:39, 1:-1:2] = 1
    (found,) = search_components(safe, Box(0, 40, 0, 203), 2, 1)
    assert len(found.boundary_cells) > LEAST_TRACE
    assert [tuple(cell) for cell in found.boundary_cells.tolist()] == moore(safe, 1, 1)


def slow_squares(safe: Map) -> NDArray[np.int32]:
    side = np.zeros(safe.shape, np.int32)
    for row, col in np.argwhere(safe):
        n = 1
        while n <= min(row, col) and safe[row - n : row + 1, col - n : col + 1].all():
            n += 1
        side[row, col] = n
    return side


@settings(max_examples=60, deadline=None)
@given(maps(), st.booleans())
def test_squares_are_those_of_brute_force(safe: Map, cut: bool) -> None:
    safe = np.ascontiguousarray(safe[1:-1, 1:-1]) if cut else safe
    np.testing.assert_array_equal(squares(safe), slow_squares(safe))


@settings(max_examples=60, deadline=None)
@given(maps(), st.integers(1, 6))
def test_components_are_those_of_scipy_that_hold_the_square(safe: Map, least: int) -> None:
    side = slow_squares(safe)
    label, count = ndimage.label(safe, EIGHT)
    large = [n for n in range(1, count + 1) if side[label == n].max() >= least]
    runs, groups = components(packed(safe), packed((side >= least).astype(np.uint8)))
    found = np.zeros(safe.shape, np.int32)
    for number, (*_, first, stop) in enumerate(groups.tolist(), start=1):
        for row, col, end, _ in runs[first:stop].tolist():
            found[row, col:end] = number
    assert set(np.unique(found)) - {0} == set(range(1, len(large) + 1))
    own = {tuple(np.flatnonzero(found == n)) for n in range(1, len(large) + 1)}
    assert own == {tuple(np.flatnonzero(label == n)) for n in large}
    for (row0, row1, col0, col1, *_), where in zip(groups.tolist(), ndimage.find_objects(found), strict=True):
        assert where == (slice(row0, row1), slice(col0, col1))


@settings(max_examples=60, deadline=None)
@given(maps(), st.integers(1, 30))
def test_crumbs_are_the_small_parts_that_hang_on_corners(safe: Map, fewest: int) -> None:
    runs, groups = components(packed(safe), packed(safe))
    label, _ = ndimage.label(safe, EIGHT)
    for row0, row1, col0, col1, first, stop in groups.tolist():
        where = slice(row0, row1), slice(col0, col1)
        row, col = runs[first, :2]
        parts, _ = ndimage.label(label[where] == label[row, col])
        size = np.bincount(parts.ravel())[1:]
        kept = np.isin(parts, 1 + np.flatnonzero(size >= min(fewest, size.max())))
        cells = np.zeros((row1 - row0, ((col1 - 1) >> 6) + 1 - (col0 >> 6)), np.uint64)
        put_without_small_parts(runs[first:stop], fewest, cells)
        np.testing.assert_array_equal(unpacked(cells, col0 & 63, col1 - col0), kept)


# ---- search -------------------------------------------------------------------------------------


def whole(part: Map, box: Box, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    out = np.zeros(shape, bool)
    out[box.row0 : box.row1, box.col0 : box.col1] = part == 1
    return out


def box_round(safe: Map) -> Box:
    """The smallest box that leaves an unsafe margin around everything safe."""
    rows, cols = np.nonzero(safe)
    if not len(rows):
        return Box(0, 0, 0, 0)
    return Box(int(rows.min()) - 1, int(rows.max()) + 2, int(cols.min()) - 1, int(cols.max()) + 2)


def check(
    candidate: Candidate, safe: Map, component: NDArray[np.bool_], kept: NDArray[np.bool_] | None = None
) -> None:
    box = candidate.box
    rows, cols = np.nonzero(component)
    assert (box.row0, box.row1) == (rows.min(), rows.max() + 1)
    assert (box.col0, box.col1) == (cols.min(), cols.max() + 1)
    kept = component if kept is None else kept
    np.testing.assert_array_equal(whole(candidate.component, box, safe.shape), kept)
    np.testing.assert_array_equal(
        whole(candidate.content, box, safe.shape), ndimage.binary_fill_holes(component)
    )
    assert candidate.square_side == slow_squares(kept.astype(np.uint8)).max()
    path = moore(component, *(int(i) for i in np.argwhere(component)[0]))
    assert [tuple(cell) for cell in candidate.boundary_cells.tolist()] == path


def without_crumbs(component: NDArray[np.bool_], least_side: int) -> NDArray[np.bool_]:
    """Return what is left of a component without parts of fewer than 9 cells that hang on a corner.

    Where no part that is left holds the square, parts of as many cells as it has stay.
    """
    parts, count = ndimage.label(component)
    sizes = {part: int((parts == part).sum()) for part in range(1, count + 1)}
    for fewest in (9, least_side**2):
        least = min(fewest, max(sizes.values()))
        left = np.isin(parts, [part for part, size in sizes.items() if size >= least])
        if slow_squares(left.astype(np.uint8)).max() >= least_side:
            break
    return left


@settings(max_examples=60, deadline=None)
@given(maps(), st.integers(1, 5), st.integers(1, 20), st.booleans())
def test_every_component_with_room_is_found_once(
    safe: Map, least_side: int, least_boundary: int, tight: bool
) -> None:
    seen = box_round(safe) if tight else Box(0, safe.shape[0], 0, safe.shape[1])
    label, count = ndimage.label(safe, EIGHT)
    expected = []
    for number in range(1, count + 1):
        component = label == number
        row, col = np.argwhere(component)[0]
        if slow_squares(component.astype(np.uint8)).max() < least_side:
            continue
        if len(moore(safe, int(row), int(col))) >= least_boundary:
            expected.append(number)
    found = list(search_components(safe[seen.slices], seen, least_side, least_boundary))
    numbers = [int(label[tuple(candidate.boundary_cells[0])]) for candidate in found]
    assert sorted(numbers) == expected
    for number, candidate in zip(numbers, found, strict=True):
        component = label == number
        check(candidate, safe, component, without_crumbs(component, least_side))


def search_source(safe: Map, least_side: int, least_boundary: int) -> list[Candidate]:
    """The source's search of a whole map; squares and components are left to other tests."""
    terrain = PaperTerrain(Grid(0.0, 0.0, 1.0, *safe.shape), params.load("quadcopter", ["mode=source"]))
    terrain.safe_bits[:, :-1] = packed(safe)
    terrain.changed = terrain.grid.everything
    found = []
    for part in PaperDetection(terrain, least_side, least_boundary).update():
        words = np.ascontiguousarray(terrain.safe_bits[part.box.row0 : part.box.row1, part.words])
        first = part.boundary_cells[0] - [part.box.row0, 64 * part.words.start]
        own = component(words & part.content, *first.tolist())
        corners = own & erosion(own, least_side)
        side = int(largest_square(corners, least_side))
        found.append(Candidate(part.boundary_cells, part.box, part.content, own, part.box.col0 & 63, side))
        assert part.n_cells == found[-1].content.sum()
    return found


def erosion(bits: NDArray[np.uint64], side: int) -> NDArray[np.uint64]:
    """Return the south-west corners of the set squares."""
    out = bits.copy()
    erode_to_side(out, 1, side)
    return out


@settings(max_examples=60, deadline=None)
@given(maps(), st.integers(1, 5), st.integers(1, 20))
def test_the_source_s_search_finds_in_raster_order_what_is_in_no_contour_found_before(
    safe: Map, least_side: int, least_boundary: int
) -> None:
    assume(safe.any())
    label, count = ndimage.label(safe, EIGHT)
    taken = np.zeros(safe.shape, bool)
    expected = []
    for number, (row, col) in enumerate(first_cells(label, count), start=1):
        component = label == number
        if taken[row, col] or len(moore(safe, row, col)) < least_boundary:
            continue
        if slow_squares(component.astype(np.uint8)).max() < least_side:
            continue
        taken |= ndimage.binary_fill_holes(component)
        expected.append(number)
    found = search_source(safe, least_side, least_boundary)
    assert [int(label[tuple(candidate.boundary_cells[0])]) for candidate in found] == expected
    covered = np.zeros(safe.shape, bool)
    for number, candidate in zip(expected, found, strict=True):
        check(candidate, safe, label == number)
        content = whole(candidate.content, candidate.box, safe.shape)
        assert not (covered & content).any()
        covered |= content


@pytest.mark.parametrize(("least_side", "source", "all_of_them"), [(3, 2, 4), (4, 2, 2), (5, 1, 1)])
def test_a_court_is_hidden_only_from_the_source_s_search_and_only_by_a_ring_with_room(
    least_side: int, source: int, all_of_them: int
) -> None:
    safe = ring_with_islands()
    seen = Box(0, safe.shape[0], 0, safe.shape[1])
    assert len(search_source(safe, least_side, 1)) == source
    assert len(list(search_components(safe[seen.slices], seen, least_side, 1))) == all_of_them
