"""Choice of the bearing and slope of an approach."""

from __future__ import annotations

import math

import numpy as np
import pytest

import params
from companion.flight.geometry.wind import Wind
from companion.flight.landing.ways.approach_path import ApproachPath
from companion.flight.landing.ways.way_choice import is_blocked, paths, straight_down_is_blocked
from slz import SAFE, UNKNOWN, UNSAFE, Corridors
from tests.unit.companion.flight.landing.flight import Flight, zone
from tests.unit.companion.flight.landing.ways.corridors import SLOPES_DEG, made

PARAMETERS = params.load("helicopter")


def found(corridors: Corridors, **options: object) -> list[ApproachPath]:
    given: dict[str, object] = {"least_state": int(SAFE), "route_over_point_m": 60.0} | options
    return paths(corridors, PARAMETERS, **given)  # type: ignore[arg-type]


def wind(from_deg: float, speed_ms: float = 6.0) -> Wind:
    return Wind(math.radians(from_deg), speed_ms, speed_ms, "autopilot")


def test_the_least_steep_clear_slope_is_flown() -> None:
    only = {(90, 30.0): int(SAFE), (90, 60.0): int(SAFE), (200, 60.0): int(SAFE)}
    best = found(made(only, all_of=int(UNSAFE)))[0]
    assert (best.bearing_deg, best.slope_deg) == (90.0, 30.0)


@pytest.mark.parametrize("from_deg", [0.0, 90.0, 255.0])
def test_in_wind_the_vehicle_comes_in_against_it(from_deg: float) -> None:
    best = found(made(), wind=wind(from_deg))[0]
    assert abs(math.degrees(math.remainder(best.inbound_rad - math.radians(from_deg), 2 * math.pi))) <= 15


def test_out_of_the_point_it_leaves_against_the_wind() -> None:
    best = found(made(), wind=wind(40.0), outbound=True)[0]
    assert abs(best.bearing_deg - 40) <= 15


def test_best_ways_in_and_out_are_those_of_the_selected_point() -> None:
    flight = Flight([zone(1, 0, 0)], height=20.0).having(wind=wind(90.0))
    assert flight.executive.ways(flight.situation()) == (None, None)
    flight.corridors = lambda _flight: made()
    flight.selected = np.zeros(3)
    inward, outward = flight.executive.ways(flight.situation())
    assert inward is not None
    assert outward is not None
    assert abs(inward.bearing_deg - 270) <= 15
    assert abs(outward.bearing_deg - 90) <= 15


def test_a_breath_of_wind_does_not_matter() -> None:
    only = {(90, 10.0): int(SAFE), (270, 30.0): int(SAFE)}
    assert found(made(only, all_of=int(UNSAFE)), wind=wind(90.0, 0.5))[0].bearing_deg == 90.0


def test_the_beginning_nearest_to_the_vehicle_is_taken_without_wind() -> None:
    best = found(made(), position_enu_m=np.array([0.0, -100.0, 60.0]))[0]
    assert best.bearing_deg == 180.0


def test_what_was_not_seen_counts_only_if_asked_for() -> None:
    corridors = made({(180, 60.0): int(SAFE)}, all_of=int(UNKNOWN))
    assert [path.bearing_deg for path in found(corridors)] == [180.0]
    assert {path.slope_deg for path in found(corridors, least_state=int(UNKNOWN))} == {10.0}


def test_of_like_slopes_the_clear_one_is_flown() -> None:
    corridors = made({(180, 10.0): int(SAFE)}, all_of=int(UNKNOWN))
    assert found(corridors, least_state=int(UNKNOWN))[0].bearing_deg == 180.0


def test_a_bearing_tried_in_vain_and_those_beside_it_are_left_out() -> None:
    bearings = {path.bearing_deg for path in found(made(), tried_deg=[0.0])}
    assert not bearings & {350.0, 355.0, 0.0, 5.0, 10.0}
    assert {345.0, 15.0} <= bearings


def test_nothing_is_found_where_all_is_blocked_or_the_vehicle_is_below_the_hover() -> None:
    assert found(made(all_of=int(UNSAFE)), least_state=int(UNKNOWN)) == []
    assert found(made(), route_over_point_m=9.0) == []


def test_a_path_begins_within_the_judged_corridor() -> None:
    p = params.load("quadcopter", ["approach_slope_deg=10", "corridor_m=40"])
    assert paths(made(), p, least_state=int(SAFE), route_over_point_m=60.0)[0].length_m == 40.0


def test_a_path_is_blocked_by_what_stands_in_it_now() -> None:
    path = found(made())[0]
    key = (int(path.bearing_deg), SLOPES_DEG[0])
    assert not is_blocked(made(), path)
    assert not is_blocked(made({key: int(UNKNOWN)}), path)
    assert is_blocked(made({key: int(UNSAFE)}), path)


def test_straight_down_is_blocked_by_what_stands_there_alone() -> None:
    assert not straight_down_is_blocked(None)
    assert not straight_down_is_blocked(made(all_of=int(UNKNOWN)))
    assert straight_down_is_blocked(made({(40, 90.0): int(UNSAFE)}))
