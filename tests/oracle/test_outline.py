"""Outlines of zones against their cells, judged by shapely."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from scipy import ndimage

from slz.zones.polygonise import polygonise, without_collinear
from tests.oracle.source_rules import moore

Cells = NDArray[np.uint8]


def polygons(cells: Cells, most_lost: float) -> list[shapely.Polygon]:
    return [shapely.Polygon(part.outer, part.holes) for part in polygonise(cells, most_lost)]


def holds(parts: list[shapely.Polygon], cells: Cells) -> NDArray[np.bool_]:
    rows, cols = np.indices(cells.shape) + 0.5
    return np.asarray(shapely.contains_xy(shapely.MultiPolygon(parts), cols, rows))


def blob(seed: int, smooth: float = 5.0, side: int = 120) -> Cells:
    """Return the component around the middle of a smooth random field."""
    field = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(side, side)), smooth)
    label, _ = ndimage.label(np.pad(field > np.quantile(field, 0.35), 2)[1:-1, 1:-1])
    largest = 1 + int(np.argmax(np.bincount(label.ravel())[1:]))
    return (label == largest).astype(np.uint8)


def noisy(shape: str, seed: int, side: int = 300) -> Cells:
    """Return a disc or a turned rectangle whose border and whose holes are as ragged as those of a survey."""
    noise = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(2, side, side)), (0, 1.2, 1.2))
    border, spots = noise / noise.std()
    y, x = np.indices((side, side)) - side / 2
    along, across = 0.9 * x + 0.436 * y, 0.9 * y - 0.436 * x
    beyond = np.hypot(x, y) - 125 if shape == "disc" else np.maximum(abs(along) - 115, abs(across) - 75)
    pits = ndimage.binary_dilation((spots > 3.9) & (beyond < -25), iterations=3)
    field = np.where(pits, 1.0, beyond + 2 * border)
    label, _ = ndimage.label(ndimage.gaussian_filter(field, 0.5) < 0)
    return (label == label[side // 2, side // 2 - 20]).astype(np.uint8)


def squares(cells: Cells) -> NDArray[np.object_]:
    rows, cols = np.nonzero(cells)
    return np.asarray(shapely.box(cols, rows, cols + 1, rows + 1))


def points(parts: list[shapely.Polygon]) -> int:
    return sum(len(ring.coords) - 1 for part in parts for ring in (part.exterior, *part.interiors))


def filtered(cells: Cells) -> int:
    """Return how many points the collinear filter leaves of the contours of the zone and of its holes.

    The zone and what it is not are traced alike, as 8-connected components, each from its first cell.
    """
    total = 0
    for wanted in (1, 0):
        label, _ = ndimage.label(np.pad(cells, 1) == wanted, np.ones((3, 3)))
        for number, where in enumerate(ndimage.find_objects(label), start=1):
            if wanted or number != label[0, 0]:
                own = np.pad(label[where] == number, 1).astype(np.uint8)
                row, col = (int(v) for v in np.argwhere(own)[0])
                total += len(without_collinear(np.array(moore(own, row, col), np.int32)))
    return total


@given(arrays(np.uint8, st.tuples(st.integers(1, 12), st.integers(1, 12)), elements=st.integers(0, 1)))
@settings(max_examples=150, deadline=None)
def test_without_loss_every_cell_and_no_other_is_inside(cells: Cells) -> None:
    parts = polygons(cells, 0.0)
    assert all(part.is_valid for part in parts)
    np.testing.assert_array_equal(holds(parts, cells), cells == 1)


@given(arrays(np.uint8, st.tuples(st.integers(1, 12), st.integers(1, 12)), elements=st.integers(0, 1)))
@settings(max_examples=150, deadline=None)
def test_holes_and_parts_are_those_of_four_connected_cells(cells: Cells) -> None:
    parts = polygonise(cells, 0.0)
    assert len(parts) == ndimage.label(cells)[1]
    outside = ndimage.label(np.pad(1 - cells, 1, constant_values=1), np.ones((3, 3)))[1] - 1
    assert sum(len(part.holes) for part in parts) == outside


@given(
    arrays(np.uint8, st.tuples(st.integers(1, 12), st.integers(1, 12)), elements=st.integers(0, 1)),
    st.sampled_from([0.0, 0.02, 0.2]),
)
@settings(max_examples=300, deadline=None)
def test_any_cells_gain_nothing_and_lose_no_more_than_they_may(cells: Cells, most_lost: float) -> None:
    parts = polygons(cells, most_lost)
    inside = holds(parts, cells)
    assert shapely.MultiPolygon(parts).is_valid
    assert not inside[cells == 0].any()
    assert sum(part.area for part in parts) >= (1 - most_lost) * cells.sum() - 1e-6
    assert (cells[~inside] == 1).sum() <= 4 * most_lost * cells.sum()


@given(st.integers(0, 10_000), st.sampled_from([1.0, 2.0, 4.0]), st.sampled_from([0.002, 0.02, 0.1]))
@settings(max_examples=60, deadline=None)
def test_ragged_zones_gain_nothing_and_lose_no_more_than_they_may(
    seed: int, smooth: float, most_lost: float
) -> None:
    cells = blob(seed, smooth, 60)
    parts = polygons(cells, most_lost)
    inside = holds(parts, cells)
    assert shapely.MultiPolygon(parts).is_valid
    assert not inside[cells == 0].any()
    assert sum(part.area for part in parts) >= (1 - most_lost) * cells.sum() - 1e-6
    assert (cells[~inside] == 1).sum() <= 4 * most_lost * cells.sum()


@pytest.mark.parametrize("seed", range(12))
def test_a_smooth_zone_needs_few_points_loses_little_and_gains_nothing(seed: int) -> None:
    cells = blob(seed)
    parts = polygons(cells, 0.02)
    inside = holds(parts, cells)
    assert not inside[cells == 0].any()
    assert sum(part.area for part in parts) >= 0.98 * cells.sum()
    assert points(parts) <= filtered(cells) / 5


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("shape", ["disc", "rectangle"])
def test_a_noisy_zone_needs_a_fifth_of_the_points_of_the_collinear_filter(shape: str, seed: int) -> None:
    cells = noisy(shape, seed)
    parts = polygons(cells, 0.02)
    inside = holds(parts, cells)
    assert shapely.MultiPolygon(parts).is_valid
    assert not inside[cells == 0].any()
    assert sum(part.area for part in parts) >= 0.98 * cells.sum()
    assert points(parts) <= filtered(cells) / 5


def test_where_points_are_few_anyway_the_line_keeps_to_the_cells() -> None:
    cells = np.zeros((210, 210), np.uint8)
    cells[5:205, 5:205] = 1
    cells[5:205:2, 204] = 0
    cells[100:110, 100:110] = 0
    (part,) = polygons(cells, 0.02)
    assert shapely.union_all(squares(cells)).buffer(0.3).contains(part)  # a corner between steps sticks out
    assert len(part.interiors) == 1


def test_an_islet_goes_before_the_share_is_passed_and_no_hole_does() -> None:
    cells = np.zeros((62, 80), np.uint8)
    cells[1:61, 1:61] = 1
    cells[61, 61:63] = 1
    cells[30, 30] = 0
    (part,) = polygons(cells, 0.02)
    assert len(part.interiors) == 1
    assert len(polygons(cells, 0.0)) == 2


def test_a_square_stays_a_square() -> None:
    cells = np.zeros((30, 30), np.uint8)
    cells[5:25, 4:26] = 1
    (part,) = polygons(cells, 0.02)
    assert part.area >= 0.98 * cells.sum()
    assert len(part.exterior.coords) <= 6


def test_nothing_has_no_outline() -> None:
    assert polygonise(np.zeros((4, 4), np.uint8)) == ()
