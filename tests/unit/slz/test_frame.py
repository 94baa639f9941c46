"""Error of the sources' spherical origin compensation (SLZ thesis, Eq. (3.15), (3.16), (4.1), (4.2))."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from slz import LocalFrame

EQUATOR_M = 6_378_137.0  # WGS-84
FLATTENING = 1 / 298.257223563
ALT_M = 400.0
REACH_M = 2500.0  # a zone of 5 km has its corners so far east and north
CORNERS = [(REACH_M, REACH_M), (REACH_M, -REACH_M), (-REACH_M, REACH_M), (-REACH_M, -REACH_M)]
LATITUDES = (-47.0, 0.0, 30.0, 47.0, 60.0)


def frame(lat_deg: float) -> LocalFrame:
    return LocalFrame(lat_deg, 8.0, ALT_M)


def radii_m(lat_deg: float) -> tuple[float, float]:
    """Radii of curvature at the frame's height: along the meridian and across it."""
    e2 = FLATTENING * (2 - FLATTENING)
    w2 = 1 - e2 * math.sin(math.radians(lat_deg)) ** 2
    across = EQUATOR_M / math.sqrt(w2)
    return across * (1 - e2) / w2 + ALT_M, across + ALT_M


def expected_error_m(lat_deg: float, east_m: float, north_m: float) -> tuple[float, float, float]:
    """Spherical less true east, north and up of a point in the tangent plane, to second order.

    The formula takes one radius R for both radii of curvature, leaves out that a parallel bends towards the
    pole (east^2 tan(lat) / 2N), and takes height above the ellipsoid, which falls away, for height above the
    plane.
    """
    meridian, across = radii_m(lat_deg)
    radius = EQUATOR_M + ALT_M
    bend = east_m**2 * math.tan(math.radians(lat_deg)) / (2 * across)
    fall = east_m**2 / (2 * across) + north_m**2 / (2 * meridian)
    return east_m * (radius / across - 1), north_m * (radius / meridian - 1) - bend, fall


def spherical_error_m(lat_deg: float, east_m: float, north_m: float) -> NDArray[np.float64]:
    """Return the same from the code: a point of the tangent plane, by the sources' formula."""
    at = frame(lat_deg)
    true = np.array([east_m, north_m, 0.0])
    return np.asarray(at.spherical_enu_m(*at.lla(true)) - true)


@pytest.mark.parametrize("lat_deg", LATITUDES)
@pytest.mark.parametrize("corner", CORNERS)
def test_the_spherical_form_is_off_by_what_the_radii_of_curvature_say(
    lat_deg: float, corner: tuple[float, float]
) -> None:
    expected = expected_error_m(lat_deg, *corner)
    np.testing.assert_allclose(spherical_error_m(lat_deg, *corner), expected, atol=0.012)


@pytest.mark.parametrize(
    ("lat_deg", "least_m", "most_m"), [(0.0, 16.84, 16.86), (47.0, 5.28, 5.93), (60.0, 6.39, 6.95)]
)
def test_the_spherical_form_is_off_by_metres_at_the_corners_of_a_zone_of_5_km(
    lat_deg: float, least_m: float, most_m: float
) -> None:
    """The figures of docs/sources.md: the nearest and the farthest of four corners."""
    errors = [spherical_error_m(lat_deg, *corner) for corner in CORNERS]
    off_m = [float(np.hypot(error[0], error[1])) for error in errors]
    assert least_m < min(off_m) < least_m + 0.02
    assert most_m - 0.02 < max(off_m) < most_m
    for error in errors:
        assert 0.97 < error[2] < 0.99


@pytest.mark.parametrize(("lat_deg", "least_m", "most_m"), [(0.0, 0.080, 0.082), (47.0, 0.025, 0.029)])
def test_the_spherical_form_is_off_by_centimetres_12_m_from_the_origin(
    lat_deg: float, least_m: float, most_m: float
) -> None:
    error = spherical_error_m(lat_deg, 12.0, 12.0)
    assert least_m < np.hypot(error[0], error[1]) < most_m
    assert error[2] < 1e-4


def test_at_the_equator_only_north_is_off_and_by_the_meridian_s_radius() -> None:
    east, north, _ = spherical_error_m(0.0, REACH_M, REACH_M)
    meridian, _ = radii_m(0.0)
    assert abs(east) < 0.001
    assert north / REACH_M == pytest.approx((EQUATOR_M + ALT_M) / meridian - 1, rel=1e-3)


@pytest.mark.parametrize("lat_deg", LATITUDES)
def test_a_boundary_point_placed_by_the_spherical_form_is_off_the_same_way_back(lat_deg: float) -> None:
    """Eq. 4.1-4.2 undo Eq. 3.15-3.16: a point they place for the pilot is off by as much, the other way."""
    at = frame(lat_deg)
    point = np.array([REACH_M, REACH_M, 0.0])
    placed = at.enu_m(*at.spherical_lla(point))
    np.testing.assert_allclose(placed - point, -spherical_error_m(lat_deg, REACH_M, REACH_M), atol=0.13)
    assert np.hypot(*(placed - point)[:2]) > 5.0


@pytest.mark.parametrize("lat_deg", LATITUDES)
def test_both_forms_undo_themselves(lat_deg: float) -> None:
    at = frame(lat_deg)
    points = np.random.default_rng(1).uniform(-REACH_M, REACH_M, (50, 3)) * [1.0, 1.0, 0.1]
    np.testing.assert_allclose(at.enu_m(*at.lla(points).T), points, atol=1e-6)
    np.testing.assert_allclose(at.spherical_enu_m(*at.spherical_lla(points).T), points, atol=1e-6)


@pytest.mark.parametrize("lat_deg", LATITUDES)
def test_the_ellipsoid_s_frame_follows_the_radii_of_curvature_near_its_origin(lat_deg: float) -> None:
    meridian, across = radii_m(lat_deg)
    step_deg = 1e-4
    north = frame(lat_deg).enu_m(lat_deg + step_deg, 8.0, ALT_M)
    east = frame(lat_deg).enu_m(lat_deg, 8.0 + step_deg, ALT_M)
    assert north[1] == pytest.approx(math.radians(step_deg) * meridian, abs=1e-4)
    assert east[0] == pytest.approx(
        math.radians(step_deg) * across * math.cos(math.radians(lat_deg)), abs=1e-4
    )
    np.testing.assert_allclose([north[0], east[1]], 0.0, atol=1e-4)


def test_height_counts_in_both_forms() -> None:
    """R + h: a degree is longer by the height above the ellipsoid, and up is the difference in height."""
    at = frame(47.0)
    low, high = at.spherical_enu_m(47.01, 8.0, 0.0), at.spherical_enu_m(47.01, 8.0, 4000.0)
    assert high[1] - low[1] == pytest.approx(math.radians(0.01) * 4000.0, abs=1e-6)
    assert high[2] - low[2] == 4000.0
    assert at.spherical_lla([0.0, 0.0, 25.0])[2] == ALT_M + 25.0
    assert at.lla([0.0, 0.0, 25.0])[2] == pytest.approx(ALT_M + 25.0, abs=1e-6)


@pytest.mark.parametrize(
    ("lat_deg", "lon_deg", "alt_m"), [(90.1, 0.0, 0.0), (0.0, 180.1, 0.0), (47.0, 8.0, math.nan)]
)
def test_an_origin_that_is_not_on_the_earth_is_refused(lat_deg: float, lon_deg: float, alt_m: float) -> None:
    with pytest.raises(ValueError, match="not on the Earth"):
        LocalFrame(lat_deg, lon_deg, alt_m)


@pytest.mark.parametrize(
    ("origin", "there", "turn_deg"),
    [
        ((47.0, 8.0), (47.0, 8.0), 0.0),
        ((47.0, 8.0), (48.0, 8.0), 1.0),
        ((0.0, 0.0), (0.0, 0.02), 0.02),
        ((0.0, 179.99), (0.0, -179.99), 0.02),
        ((60.0, 8.0), (60.0, 8.02), 0.02),
        ((90.0, 0.0), (90.0, 30.0), 30.0),  # the same place, its east another
        ((-45.0, 10.0), (45.0, -170.0), 180.0),
    ],
)
def test_the_turn_of_the_axes_is_that_of_latitude_and_longitude(
    origin: tuple[float, float], there: tuple[float, float], turn_deg: float
) -> None:
    frame = LocalFrame(*origin, 0.0)
    assert math.degrees(frame.turn_rad(*there)) == pytest.approx(turn_deg, abs=1e-6)
