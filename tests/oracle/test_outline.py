"""Outlines against the cells they are drawn around, judged by shapely."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from scipy import ndimage

from slz.boundary import without_collinear
from slz.kernels.contour import trace
from slz.outline import outline

Cells = NDArray[np.uint8]


def polygons(cells: Cells, most_lost: float) -> list[shapely.Polygon]:
    return [shapely.Polygon(part.outer, part.holes) for part in outline(cells, most_lost)]


def holds(parts: list[shapely.Polygon], cells: Cells) -> NDArray[np.bool_]:
    rows, cols = np.indices(cells.shape) + 0.5
    return np.asarray(shapely.contains_xy(shapely.MultiPolygon(parts), cols, rows))


def blob(seed: int, smooth: float = 5.0, side: int = 120) -> Cells:
    """Return the component around the middle of a smooth random field."""
    field = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(side, side)), smooth)
    label, _ = ndimage.label(np.pad(field > np.quantile(field, 0.35), 2)[1:-1, 1:-1])
    largest = 1 + int(np.argmax(np.bincount(label.ravel())[1:]))
    return (label == largest).astype(np.uint8)


@given(arrays(np.uint8, st.tuples(st.integers(1, 12), st.integers(1, 12)), elements=st.integers(0, 1)))
@settings(max_examples=150, deadline=None)
def test_without_loss_every_cell_and_no_other_is_inside(cells: Cells) -> None:
    parts = polygons(cells, 0.0)
    assert all(part.is_valid for part in parts)
    np.testing.assert_array_equal(holds(parts, cells), cells == 1)


@given(arrays(np.uint8, st.tuples(st.integers(1, 12), st.integers(1, 12)), elements=st.integers(0, 1)))
@settings(max_examples=150, deadline=None)
def test_holes_and_parts_are_those_of_four_connected_cells(cells: Cells) -> None:
    parts = outline(cells, 0.0)
    assert len(parts) == ndimage.label(cells)[1]
    outside = ndimage.label(np.pad(1 - cells, 1, constant_values=1), np.ones((3, 3)))[1] - 1
    assert sum(len(part.holes) for part in parts) == outside


@pytest.mark.parametrize("seed", range(12))
def test_a_smooth_zone_needs_few_points_loses_little_and_gains_nothing(seed: int) -> None:
    cells = blob(seed)
    parts = polygons(cells, 0.02)
    inside = holds(parts, cells)
    assert not inside[cells == 0].any()
    assert sum(part.area for part in parts) >= 0.98 * cells.sum()
    row, col = (int(v) for v in np.argwhere(cells)[0])
    filtered = without_collinear(trace(cells, row, col, 100_000))
    outer = sum(len(part.exterior.coords) - 1 for part in parts)
    assert outer <= len(filtered) / 2.5


def test_a_square_stays_a_square() -> None:
    cells = np.zeros((30, 30), np.uint8)
    cells[5:25, 4:26] = 1
    (part,) = polygons(cells, 0.02)
    assert part.area >= 0.98 * cells.sum()
    assert len(part.exterior.coords) <= 6


def test_nothing_has_no_outline() -> None:
    assert outline(np.zeros((4, 4), np.uint8)) == ()
