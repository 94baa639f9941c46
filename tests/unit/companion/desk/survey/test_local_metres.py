"""Local metres: lengths on the ground, along the axes of the CRS."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Geod, Transformer

from companion.desk.clouds.crs import from_option
from companion.desk.survey.local_metres import Metric, metric_for
from companion.runtime.errors import UsageError

SYSTEMS = ["EPSG:2992", "EPSG:32610", "EPSG:2225", "EPSG:3857", "EPSG:4326", "EPSG:5070", "EPSG:26910+6360"]


def metric(crs: str, lon: float = -123.07, lat: float = 44.05, extent: float = 100.0) -> Metric:
    reference = from_option(crs)
    x, y = Transformer.from_crs("EPSG:4326", reference.horizontal, always_xy=True).transform(lon, lat)
    half = extent / (reference.unit_m or 111_000.0)
    return metric_for(
        reference, np.array([x - half, y - half, 30.2]), np.array([x + half, y + half, 50.0]), 0.5
    )


@pytest.mark.parametrize("crs", SYSTEMS)
def test_metres_are_those_on_the_ground(crs: str) -> None:
    here = metric(crs)
    ends = here.lonlat(np.array([[-50.0, 0, 0], [50, 0, 0], [0, -50, 0], [0, 50, 0]]))
    geod = Geod(ellps="WGS84")
    length = [geod.inv(*ends[i], *ends[i + 1])[2] for i in (0, 2)]
    assert length == pytest.approx([100, 100], rel=0.0021)
    assert length[0] * length[1] == pytest.approx(1e4 * here.area_factor, rel=1e-4)


@pytest.mark.parametrize("crs", SYSTEMS)
@settings(max_examples=25, deadline=None)
@given(east=st.floats(-500, 500), north=st.floats(-500, 500), up=st.floats(-100, 9000), lat=st.floats(25, 49))
def test_there_and_back_is_the_same_place(crs: str, east: float, north: float, up: float, lat: float) -> None:
    here = metric(crs, lat=lat)
    point = np.array([[east, north, up]])
    z = here.altitude_m(up) / here.z_m
    there = np.column_stack([here.crs_xy(point), [z]])
    np.testing.assert_allclose(here.local(there), point, atol=1e-6)


@pytest.mark.parametrize(("crs", "pixel"), [("EPSG:2992", 0.5 / 0.3048), ("EPSG:32610", 0.5)])
def test_a_projected_crs_keeps_its_unit_and_its_cells_lie_on_multiples_of_it(crs: str, pixel: float) -> None:
    here = metric(crs)
    assert 0.5 / here.x_m == pytest.approx(pixel, rel=1e-12)
    for coordinate in here.origin[:2]:
        assert coordinate / pixel == pytest.approx(round(coordinate / pixel), abs=1e-6)


def test_the_frame_lies_at_the_centre() -> None:
    here = metric("EPSG:2992")
    assert (here.frame.lon_deg, here.frame.lat_deg) == pytest.approx((-123.07, 44.05), abs=1e-5)
    assert here.frame.alt_m == pytest.approx(30 * 0.3048)


def test_feet_high_ground_is_feet_high() -> None:
    here = metric("EPSG:26910+6360")
    assert here.altitude_m(10.0) == pytest.approx(30 * 1200 / 3937 + 10)


@pytest.mark.parametrize(
    ("crs", "corner"), [("EPSG:4326", (500, 4000)), ("EPSG:32610", (1e9, 1e9)), ("EPSG:2992", (np.inf, 0))]
)
def test_coordinates_that_are_not_on_the_earth_are_refused(crs: str, corner: tuple[float, float]) -> None:
    low = np.array([*corner, 0.0])
    with pytest.raises(UsageError, match=r"not on the Earth.*--crs"):
        metric_for(from_option(crs), low, low + 1, 0.5)


def test_a_cloud_so_large_that_its_units_differ_is_refused() -> None:
    with pytest.raises(UsageError, match="changes its length"):
        metric("EPSG:3857", extent=200_000)


def test_a_crs_of_another_celestial_body_is_refused() -> None:
    low = np.zeros(3)
    with pytest.raises(UsageError, match=r"Moon.*not tied to the Earth.*--crs"):
        metric_for(from_option("IAU_2015:30100"), low, low + 1e-4, 0.5)


@pytest.mark.parametrize(("crs", "turn"), [("EPSG:4326", 360.0), ("EPSG:3857", 40_075_016.686)])
def test_a_cloud_across_the_180th_meridian_is_refused_in_one_line(crs: str, turn: float) -> None:
    low, high = np.array([-turn / 2, 0.1, 0]), np.array([turn / 2 * 0.999999, 0.2, 9])
    with pytest.raises(UsageError, match="across the 180th meridian do: map either side on its own") as said:
        metric_for(from_option(crs), low, high, 0.5)
    assert "\n" not in str(said.value)


def test_a_crs_that_goes_on_beyond_the_180th_meridian_is_used_there() -> None:
    around_it = metric_for(
        from_option("EPSG:3031"), np.array([-50.0, -2e6, 0]), np.array([50.0, -1.9999e6, 9]), 0.5
    )
    assert abs(around_it.frame.lon_deg) == pytest.approx(180, abs=1e-3)
