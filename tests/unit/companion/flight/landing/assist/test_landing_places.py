"""Nearest place that the autopilot reaches straight on: walls, unseen ground, fence and people."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.flight.geometry.geofence import Boundary, Geofence
from companion.flight.landing.assist.landing_places import LandingPlace, nearest_place
from companion.flight.landing.situation import Vector
from slz import MovingObject, Nearby
from slz.landing_point.corridors import corridor_radius_m
from tests.unit.companion.flight.landing.assist.ground_around import Area, ground_around
from tests.unit.companion.flight.landing.flight import Flight

EAST: Area = (10.0, -3.0, 16.0, 3.0)
NORTH: Area = (-3.0, 20.0, 3.0, 26.0)
WALL: Area = (5.0, -8.0, 6.0, 8.0)
EVERYWHERE: Area = (-30.0, -30.0, 30.0, 30.0)


def found(
    around: Nearby,
    height_m: float = 20.0,
    velocity: tuple[float, float] = (0.0, 0.0),
    refused: tuple[Vector, ...] = (),
    before: Vector | None = None,
    **changes: object,
) -> LandingPlace | None:
    flight = Flight([], height=height_m).having(around=around, **changes)
    flight.velocity = np.array([*velocity, 0.0])
    return nearest_place(flight.situation(), flight.parameters, before, refused)


def test_over_safe_ground_the_place_is_below() -> None:
    place = found(ground_around([EVERYWHERE]))
    assert place is not None
    assert place.away_m < 0.5


def test_the_nearest_place_is_taken_and_its_direction_told() -> None:
    place = found(ground_around([EAST, NORTH]))
    assert place is not None
    assert place.away_m == pytest.approx(math.hypot(*place.enu_m[:2]))
    assert 10 <= place.away_m <= 12.5
    assert place.bearing_deg == pytest.approx(90, abs=10)


def test_a_place_with_room_around_it_is_worth_two_metres() -> None:
    place = found(ground_around([(10.0, -0.5, 10.5, 0.0), (11.0, -3.0, 16.0, 3.0)]))
    assert place is not None
    assert 12 < place.enu_m[0] < 13


@pytest.mark.parametrize(("top_m", "east"), [(10.0, True), (17.5, True), (18.5, False), (25.0, False)])
def test_a_wall_as_high_as_the_vehicle_blocks_the_way(top_m: float, east: bool) -> None:
    place = found(ground_around([EAST, NORTH], [(WALL, top_m)]))
    assert place is not None
    assert (place.enu_m[0] > 9) == east


def test_ground_that_nobody_has_seen_blocks_the_way() -> None:
    assert found(ground_around([EAST], unknown=[WALL])) is None
    assert found(ground_around([EAST])) is not None


def test_over_ground_that_nobody_has_seen_no_way_is_free() -> None:
    assert found(ground_around([EAST], unknown=[(-5.0, -5.0, 5.0, 5.0)])) is None


def test_near_the_ground_a_place_farther_aside_than_half_the_height_is_none() -> None:
    near: Area = (2.0, -1.0, 4.0, 1.0)
    assert found(ground_around([near]), height_m=6.0) is not None
    assert found(ground_around([near]), height_m=3.0) is None
    assert found(ground_around([near]), height_m=4.9) is not None


def test_a_place_farther_aside_than_three_heights_is_none() -> None:
    """ArduPilot drops a target above its own plane (target_vec_valid): from 5 m, 15 m away was flown."""
    far: Area = (24.0, -2.0, 28.0, 2.0)
    assert found(ground_around([far]), height_m=12.0) is not None
    assert found(ground_around([far]), height_m=7.0) is None


def test_a_fast_vehicle_takes_a_place_ahead() -> None:
    ahead, behind = (-3.0, 10.0, 3.0, 12.0), (-3.0, -8.0, 3.0, -6.0)
    fast, slow = (found(ground_around([ahead, behind]), velocity=(0.0, ms)) for ms in (7.0, 0.0))
    assert fast is not None
    assert slow is not None
    assert fast.enu_m[1] > 0 > slow.enu_m[1]


def test_places_beside_one_that_proved_unsafe_are_left_out() -> None:
    first = found(ground_around([EVERYWHERE]))
    assert first is not None
    other = found(ground_around([EVERYWHERE]), refused=(first.enu_m,))
    assert other is not None
    assert math.hypot(*(other.enu_m - first.enu_m)[:2]) > corridor_radius_m(Flight([]).parameters)


def test_a_place_beyond_the_fence_is_none() -> None:
    circle = Geofence(Boundary(np.zeros((1, 2)), 15.0, True), margin_m=2.0)
    place = found(ground_around([EAST, NORTH]), fence=circle)
    assert place is not None
    assert place.away_m <= 13
    assert found(ground_around([NORTH]), fence=circle) is None


def test_a_place_to_which_somebody_walks_is_none() -> None:
    walker = MovingObject(1, 0, np.array([20.0, 0.0]), np.array([-1.5, 0.0]), 0.4, 1.8, 0.0)
    flight = Flight([]).having(around=ground_around([EAST, NORTH]), moving=lambda _: (walker,))
    place = nearest_place(flight.situation(), flight.parameters)
    assert place is not None
    assert place.enu_m[1] > 19


def test_the_place_before_is_kept_while_it_is_about_as_good() -> None:
    around = ground_around([EVERYWHERE])
    place = found(around, before=np.array([1.75, 0.25, 0.0]))
    assert place is not None
    assert place.enu_m[:2] == pytest.approx([1.75, 0.25])
    far = found(around, before=np.array([12.25, 0.25, 0.0]))
    assert far is not None
    assert far.away_m < 0.5


# ---- properties -------------------------------------------------------------------------------------

edges = st.integers(-28, 26)
areas = st.builds(
    lambda w, s, e, n: (float(w), float(s), float(w + e), float(s + n)),
    edges, edges, st.integers(1, 4), st.integers(1, 4),
)  # fmt: skip
walls = st.lists(st.tuples(areas, st.floats(0.0, 30.0)), max_size=6)


def touches(place: LandingPlace, walls: list[tuple[Area, float]], height_m: float, radius_m: float) -> bool:
    """Return whether a disc on the way to a place touches a wall that rises to the vehicle, step by step."""
    way_m = np.linspace(0.0, 1.0, 200)[:, None] * place.enu_m[:2]
    for (west_m, south_m, east_m, north_m), top_m in walls:
        middle_m = np.clip(way_m, (west_m + 0.25, south_m + 0.25), (east_m - 0.25, north_m - 0.25))
        if top_m > height_m - 2.0 and (np.hypot(*(way_m - middle_m).T) < radius_m - 0.4).any():
            return True
    return False


@given(walls=walls, places=st.lists(areas, min_size=1, max_size=4), height_m=st.floats(6.0, 25.0))
def test_no_way_leads_past_what_rises_to_the_vehicle(
    walls: list[tuple[Area, float]], places: list[Area], height_m: float
) -> None:
    radius_m = corridor_radius_m(Flight([]).parameters)
    standing = [one for one in walls if math.hypot(*one[0][:2]) > 6 + radius_m]  # not around the vehicle
    place = found(ground_around(places, standing), height_m)
    assert place is None or place.away_m < 1 or not touches(place, standing, height_m, radius_m)


@given(walls=walls, places=st.lists(areas, min_size=1, max_size=4), more=areas)
def test_another_wall_brings_no_place_nearer(
    walls: list[tuple[Area, float]], places: list[Area], more: Area
) -> None:
    before, after = (found(ground_around(places, w)) for w in (walls, [*walls, (more, 30.0)]))
    assert after is None or before is not None
    if before is not None and after is not None:
        assert after.away_m >= before.away_m - 2.0 - 0.5  # of places not farther by 2 m the widest is taken
