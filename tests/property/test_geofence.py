"""Properties of the geofence, compared with shapely."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Point, Polygon

from companion.flight.geometry.geofence import NO_FENCE, Boundary, Geofence
from companion.flight.landing.guidance import BRAKING_MS2

metres = st.floats(-60, 60)
places = st.tuples(metres, metres).map(np.array)
radii = st.floats(5, 80)
margins = st.floats(0, 6)


@st.composite
def stars(draw: st.DrawFn) -> np.ndarray:
    """A polygon that does not cross itself, convex or not."""
    middle = draw(places)
    lengths = draw(st.lists(st.floats(4, 50), min_size=3, max_size=9))
    angles = np.linspace(0, 2 * math.pi, len(lengths), endpoint=False)
    return middle + np.array(lengths)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)


@st.composite
def boundaries(draw: st.DrawFn) -> Boundary:
    inclusion = draw(st.booleans())
    if draw(st.booleans()):
        return Boundary(draw(places)[None], draw(radii), inclusion)
    return Boundary(draw(stars()), 0.0, inclusion)


circles = st.builds(lambda place, radius: Boundary(place[None], radius, True), places, radii)
fences = st.builds(
    Geofence,
    st.one_of(st.none(), circles),
    st.lists(boundaries(), max_size=4).map(tuple),
    st.booleans(),
    margins,
)


def room_by_shapely_m(boundary: Boundary, place: np.ndarray) -> float:
    point = Point(*place)
    if boundary.radius_m:
        inside = boundary.radius_m - point.distance(Point(*boundary.corners_m[0]))
    else:
        area = Polygon(boundary.corners_m)
        inside = point.distance(area.exterior) * (1 if area.contains(point) else -1)
    return inside if boundary.inclusion else -inside


@settings(deadline=None, max_examples=100)
@given(boundaries(), places)
def test_the_room_of_a_boundary_is_the_distance_to_its_edge(boundary: Boundary, place: np.ndarray) -> None:
    assert boundary.room_m(place[None])[0] == pytest.approx(room_by_shapely_m(boundary, place), abs=1e-6)


@settings(deadline=None, max_examples=100)
@given(fences, places)
def test_a_place_is_inside_where_each_boundary_leaves_the_margin(fence: Geofence, place: np.ndarray) -> None:
    rooms = [(one.inclusion, room_by_shapely_m(one, place)) for one in fence.areas]
    if fence.circle is not None:
        rooms.append((False, room_by_shapely_m(fence.circle, place)))  # needed like an exclusion
    inclusions = [room for inclusion, room in rooms if inclusion]
    inside = (any if fence.is_union else all)(room >= fence.margin_m for room in inclusions)
    inside = (inside or not inclusions) and all(room >= fence.margin_m for one, room in rooms if not one)
    if all(abs(room - fence.margin_m) > 1e-6 for _, room in rooms):
        assert fence.holds(place) is inside


@settings(deadline=None, max_examples=100)
@given(fences, places, places)
def test_a_way_inside_touches_no_boundary(fence: Geofence, start: np.ndarray, end: np.ndarray) -> None:
    if not (fence.holds(start) and fence.holds_way(start, end)):
        return
    way = LineString([start, end])
    for one in fence.boundaries:
        if not one.inclusion and fence.margin_m > 0.3:
            area = Point(*one.corners_m[0]).buffer(one.radius_m) if one.radius_m else Polygon(one.corners_m)
            assert not way.intersects(area)
    assert fence.holds(end)


@settings(deadline=None, max_examples=100)
@given(fences, places, st.floats(0, 8), st.floats(0, 2 * math.pi))
def test_a_limited_velocity_stops_before_the_margin(
    fence: Geofence, start: np.ndarray, speed: float, angle: float
) -> None:
    course = np.array([math.cos(angle), math.sin(angle), 0.0])
    limited = fence.limited(np.array([*start, 10.0]), speed * course, BRAKING_MS2)
    left = float(np.hypot(*limited[:2]))
    assert left <= speed + 1e-9
    assert np.allclose(limited[:2], left * course[:2])
    stop_m = left**2 / (2 * BRAKING_MS2)
    along = start + np.linspace(0, stop_m, 60)[:, None] * course[:2]
    rooms = fence.room_m(along)
    assert rooms.min() >= min(0.0, float(rooms[0])) - 0.51


@settings(deadline=None, max_examples=100)
@given(st.floats(-50, 50), st.floats(1, 80), st.floats(-60, 120), st.floats(-6, 6))
def test_a_limited_climb_stops_at_the_heights(lowest: float, band: float, up: float, climb: float) -> None:
    fence = Geofence(lowest_m=lowest, highest_m=lowest + band)
    left = float(fence.limited(np.array([0.0, 0.0, up]), np.array([1.0, 2.0, climb]), BRAKING_MS2)[2])
    end = up + math.copysign(left**2 / (2 * BRAKING_MS2), left)
    assert min(lowest, up) - 1e-6 <= end <= max(fence.highest_m, up) + 1e-6
    assert abs(left) <= abs(climb)


def test_without_a_fence_everything_is_inside() -> None:
    velocity = np.array([3.0, 4.0, -1.0])
    assert NO_FENCE.is_open
    assert NO_FENCE.holds_landing(np.array([1e6, 0.0, -400.0]), 0.0)
    assert NO_FENCE.holds_way(np.zeros(3), np.array([1e6, 0.0, 0.0]))
    assert np.array_equal(NO_FENCE.limited(np.zeros(3), velocity, BRAKING_MS2), velocity)


def test_beyond_the_margin_only_the_way_back_is_open() -> None:
    fence = Geofence(Boundary(np.zeros((1, 2)), 20.0, True), margin_m=4.0)
    outside, inside = np.array([18.0, 0.0, 10.0]), np.zeros(3)
    assert not fence.holds(outside)
    assert fence.holds_way(outside, inside)
    assert not fence.holds_way(outside, np.array([19.0, 0.0]))
    assert np.allclose(fence.limited(outside, np.array([-3.0, 0.0, 0.0]), BRAKING_MS2), [-3.0, 0.0, 0.0])
    assert np.allclose(fence.limited(outside, np.array([3.0, 0.0, 0.0]), BRAKING_MS2), 0.0)
