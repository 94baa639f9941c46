"""Boundary without collinear points: it encloses the same ground (SLZ paper, Algorithm 2)."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import ndimage

from slz.zones.polygonise import without_collinear
from tests.oracle.source_rules import moore

Map = NDArray[np.uint8]


def polygon(cells: NDArray[np.int32]) -> shapely.Geometry:
    return shapely.make_valid(shapely.Polygon(cells))


def contours(safe: NDArray[np.bool_]) -> list[NDArray[np.int32]]:
    """Contours of all components that hold more than two cells in a square."""
    label, count = ndimage.label(safe, np.ones((3, 3)))
    found = []
    for number in range(1, count + 1):
        component = label == number
        if ndimage.binary_erosion(component, np.ones((2, 2))).any():
            row, col = np.argwhere(component)[0]
            found.append(np.array(moore(component.astype(np.uint8), row, col), np.int32))
    return found


@st.composite
def random_maps(draw: st.DrawFn) -> NDArray[np.bool_]:
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    noise = rng.random((draw(st.integers(4, 30)), draw(st.integers(4, 30))))
    if draw(st.booleans()):
        noise = ndimage.gaussian_filter(noise, 1.5)
    return np.pad(noise > np.quantile(noise, draw(st.sampled_from([0.2, 0.5, 0.7]))), 1)


@settings(max_examples=60, deadline=None)
@given(random_maps())
def test_the_polygon_stays_the_same(safe: NDArray[np.bool_]) -> None:
    for boundary in contours(safe):
        corners = without_collinear(boundary)
        assert len(corners) >= 3
        before, after = polygon(boundary), polygon(corners)
        assert shapely.symmetric_difference(before, after).area == pytest.approx(0, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(random_maps())
def test_corners_are_boundary_points_in_their_order(safe: NDArray[np.bool_]) -> None:
    for boundary in contours(safe):
        left = iter(boundary.tolist())
        assert all(corner in left for corner in without_collinear(boundary).tolist())


@settings(max_examples=60, deadline=None)
@given(random_maps())
def test_no_corner_lies_between_two_others_in_its_row_or_column(safe: NDArray[np.bool_]) -> None:
    """On ground without spurs one cell wide, where the contour runs back along itself."""
    broad = ndimage.binary_opening(safe, np.ones((2, 2)))
    for boundary in contours(broad):
        corners = without_collinear(boundary)
        before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
        assert not ((before == corners) & (after == corners)).any()


@pytest.mark.parametrize(("rows", "cols"), [(2, 2), (3, 9), (20, 7)])
def test_a_rectangle_has_four_corners(rows: int, cols: int) -> None:
    (boundary,) = contours(np.pad(np.ones((rows, cols), bool), 1))
    expected = {(1, 1), (1, cols), (rows, 1), (rows, cols)}
    corners = [tuple(corner) for corner in without_collinear(boundary).tolist()]
    assert len(corners) == 4
    assert set(corners) == expected


def test_corners_between_a_run_and_a_diagonal_stay() -> None:
    """An octagon: the algorithm as printed loses some of its corners."""
    safe = np.ones((9, 9), bool)
    for corner in ((0, 0), (0, -1), (-1, 0), (-1, -1)):
        rows, cols = (np.arange(3) if i == 0 else np.arange(-1, -4, -1) for i in corner)
        for depth in range(3):
            safe[rows[depth], cols[: 3 - depth]] = False
    (boundary,) = contours(np.pad(safe, 1))
    corners = {tuple(corner) for corner in without_collinear(boundary).tolist()}
    assert {(1, 4), (1, 6), (4, 1), (6, 1), (9, 4), (9, 6), (4, 9), (6, 9)} <= corners
    assert polygon(boundary).area == pytest.approx(polygon(without_collinear(boundary)).area)


def test_the_tip_of_a_spur_stays() -> None:
    cells = [(1, 1), (1, 2), (1, 3), (2, 4), (2, 5), (2, 6), (2, 5), (2, 4), (3, 3), (3, 2), (3, 1), (2, 1)]
    kept = without_collinear(np.array(cells, np.int32))
    assert [2, 6] in kept.tolist()
    assert [2, 5] not in kept.tolist()


def test_a_single_cell_is_its_own_boundary() -> None:
    assert without_collinear(np.array([[4, 7]], np.int32)).tolist() == [[4, 7]]
