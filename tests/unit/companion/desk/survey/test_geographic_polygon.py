"""Geographic polygons: exactly the zone's cells, valid, with holes, in degrees."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from pyproj import Geod

from companion.desk.clouds.crs import from_option
from companion.desk.survey.findings import square_centre
from companion.desk.survey.local_metres import metric_for, wgs84
from companion.flight.outputs.geojson_features import zone_polygon
from slz import SAFE, UNSAFE, Box, Grid, LandingPoint, LocalFrame, TerrainMaps, Zone
from slz.terrain.layers import NAMED

GRID = Grid(-10.0, -20.0, 0.5, 60, 50)
Cells = NDArray[np.uint8]


def zone(cells: Cells, row0: int = 7, col0: int = 4) -> Zone:
    box = Box(row0, row0 + cells.shape[0], col0, col0 + cells.shape[1])
    best = LandingPoint(np.array([-6.0, -14.0, 0.0]), 1.0, 2.0, 0.0, 1.0)
    area_m2, boundary, corners = float(cells.sum()) / 4, np.zeros((0, 2), np.int32), np.zeros((0, 3))
    return Zone(1, box, area_m2, 1.0, 1, 0, 0, 0.0, 0.0, boundary, best, cells, corners, ())


@settings(deadline=None)
@given(arrays(np.uint8, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.integers(0, 1)))
def test_any_cells_give_valid_polygons_without_a_cell_beside(cells: Cells) -> None:
    shape = zone_polygon(zone(cells), GRID)
    assert shape.is_valid
    rows, cols = np.indices(cells.shape)
    east, north = -10 + (cols + 4.5) * 0.5, -20 + (rows + 7.5) * 0.5
    assert not shapely.contains_xy(shape, east, north)[cells == 0].any()


def test_a_hole_stays_a_hole() -> None:
    cells = np.ones((9, 9), np.uint8)
    cells[4, 4] = 0
    (part,) = zone_polygon(zone(cells), GRID).geoms
    assert len(part.interiors) == 1


def test_outer_rings_run_anticlockwise_and_holes_clockwise() -> None:
    cells = np.ones((5, 5), np.uint8)
    cells[2, 2] = 0
    metric = metric_for(
        from_option("EPSG:32610"), np.array([5e5, 4e6, 0]), np.array([5.01e5, 4.001e6, 1]), 0.5
    )
    (part,) = wgs84(zone_polygon(zone(cells), GRID), metric).geoms
    assert shapely.is_ccw(part.exterior)
    assert not shapely.is_ccw(part.interiors[0])
    west, south, east, north = part.bounds
    assert -124 < west < east < -122  # longitude comes first
    assert 36 < south < north < 37


def test_a_zone_across_the_date_line_is_cut_along_it() -> None:
    cells = np.ones((9, 9), np.uint8)
    cells[4, 4] = 0
    metric = metric_for(
        from_option("EPSG:32701"),
        np.array([180_206.0, 8_140_143, 0]),
        np.array([180_216.0, 8_140_153, 1]),
        0.5,
    )
    shape = wgs84(zone_polygon(zone(cells), Grid(-4.0, -4.0, 0.5, 60, 50)), metric)
    assert shape.is_valid
    assert len(shape.geoms) == 2
    assert sorted(float(np.sign(part.bounds[0])) for part in shape.geoms) == [-1, 1]
    assert all(part.bounds[2] - part.bounds[0] < 1e-4 for part in shape.geoms)
    area = sum(abs(Geod(ellps="WGS84").geometry_area_perimeter(part)[0]) for part in shape.geoms)
    assert area == pytest.approx(80 * 0.25 * metric.area_factor, rel=0.001)


def test_a_zone_around_a_pole_is_left_as_it_is() -> None:
    cells = np.zeros((8, 8), np.uint8)
    cells[2:6] = cells[:, 2:6] = 1  # a cross, its centre at the pole
    pole = np.array([2e6, 2e6, 0])
    metric = metric_for(from_option("EPSG:32661"), pole - 10, pole + 10, 0.5)
    outline = zone_polygon(zone(cells, 0, 0), Grid(-2.0, -2.0, 0.5, 8, 8))
    (part,) = wgs84(outline, metric).geoms
    assert len(part.exterior.coords) == len(outline.geoms[0].exterior.coords)
    assert shapely.get_coordinates(part)[:, 1].min() > 89.9999
    assert part.bounds[2] - part.bounds[0] > 180


def test_the_square_lies_on_safe_cells_only() -> None:
    cells = np.zeros((10, 12), np.uint8)
    cells[1:8, 2:9] = 1
    cells[8, 2:12] = 1
    state = np.full((60, 50), UNSAFE, np.uint8)
    state[7:17, 4:16][cells == 1] = SAFE
    blank = np.zeros((60, 50), np.float32)
    frame = LocalFrame(44.0, -123.0, 0.0)
    maps = TerrainMaps(frame, GRID, GRID.everything, dict.fromkeys(NAMED, blank), state)
    east, north = square_centre(zone(cells), maps)
    assert east == pytest.approx(-10 + (4 + 2 + 3.5) * 0.5)
    assert -20 + (7 + 1 + 3.5) * 0.5 <= north <= -20 + (7 + 2 + 3.5) * 0.5
