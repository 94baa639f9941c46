"""Time to reach a point with the wind, how long the battery lasts, and the zone that an emergency takes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import params
from companion.flight.geometry.wind import Wind
from companion.flight.landing.situation import Emergency
from companion.flight.landing.ways.endurance import RESERVE_PCT, Endurance, reach_time_s
from tests.unit.companion.flight.landing.flight import Flight, zone

P = params.load("quadcopter", ["approach_speed_ms=8", "max_airspeed_ms=12"])
HERE = np.array([0.0, 0.0, 20.0])
SECOND = 1_000_000_000


def wind(from_deg: float, speed_ms: float) -> Wind:
    return Wind(math.radians(from_deg), speed_ms, speed_ms, "autopilot")


def seconds(east: float, north: float, w: Wind | None = None) -> float:
    return reach_time_s(HERE, np.array([east, north, 0.0]), P, w)


def test_it_is_the_level_way_and_the_descent() -> None:
    sink_s = (20 - P.commit_height_m) / P.descent_speed_ms + P.commit_height_m / 0.5
    assert seconds(0, 80) - seconds(0, 0) == pytest.approx(10.0)
    assert seconds(0, 0) == pytest.approx(4.0 + sink_s)


def test_against_the_wind_it_takes_longer_and_with_it_not_less_than_commanded() -> None:
    assert seconds(0, 80, wind(0, 10)) - seconds(0, 0) == pytest.approx(80 / 2)
    assert seconds(0, 80, wind(180, 10)) == seconds(0, 80)


@pytest.mark.parametrize("from_deg", [0.0, 90.0])
def test_a_wind_stronger_than_the_vehicle_makes_a_point_unreachable(from_deg: float) -> None:
    assert seconds(0, 80, wind(from_deg, 12.5)) == math.inf
    assert math.isfinite(seconds(0, 0, wind(from_deg, 12.5)))


@given(st.floats(0, 360), st.floats(0, 11), st.floats(0, 360))
def test_more_wind_from_ahead_is_never_sooner(turn_deg: float, speed_ms: float, from_deg: float) -> None:
    way = 100 * np.array([math.sin(math.radians(turn_deg)), math.cos(math.radians(turn_deg))])
    with_wind = seconds(*way, wind(from_deg, speed_ms))
    assert with_wind >= seconds(*way) - 1e-9
    turned = [math.radians(turn_deg + 90), math.radians(from_deg + 90)]
    again = seconds(
        *(100 * np.array([math.sin(turned[0]), math.cos(turned[0])])), wind(from_deg + 90, speed_ms)
    )
    assert again == pytest.approx(with_wind)


def after(*charges: tuple[float, float]) -> Endurance:
    one = Endurance()
    for at_s, pct in charges:
        one.follow(replace(Flight([]).situation(), now_ns=round(at_s * SECOND), battery_pct=pct))
    return one


def test_the_battery_lasts_as_its_charge_has_fallen() -> None:
    one = after((0, 80), (30, 79), (60, 78), (90, 77))
    assert one.left_s(90 * SECOND) == pytest.approx((77 - RESERVE_PCT) * 30)
    assert one.left_s(100 * SECOND) == pytest.approx((77 - RESERVE_PCT) * 30 - 10)


def test_one_percent_tells_nothing_and_a_new_battery_begins_anew() -> None:
    assert after((0, 80), (30, 79)).left_s(30 * SECOND) is None
    assert after((0, 30), (30, 28), (60, 26), (90, 95)).left_s(90 * SECOND) is None
    assert after((0, 30), (30, 4)).left_s(30 * SECOND) == 0.0
    assert Endurance().left_s(0) is None


def test_only_the_last_minutes_count() -> None:
    slow_then_fast = [(60.0 * k, 90.0 - k) for k in range(10)] + [
        (600 + 10.0 * k, 80.0 - k) for k in range(31)
    ]
    left_s = after(*slow_then_fast).left_s(900 * SECOND)
    assert left_s == pytest.approx((50 - RESERVE_PCT) * 10, rel=0.05)


def hovering(*zones: tuple[float, float], **settings: Any) -> Flight:
    settings = {"max_airspeed_ms": 12.0, "approach_speed_ms": 8.0} | settings
    return Flight([zone(k + 1, *place) for k, place in enumerate(zones)], height=20.0, auto=False, **settings)


def emergency(one: Flight) -> Emergency:
    found = one.executive.emergency(one.situation())
    assert found is not None
    return found


def test_the_emergency_s_zone_is_known_before_it_is_ordered() -> None:
    one = hovering((0, 60), (0, -80))
    one.step()
    assert emergency(one).zone_id == 1
    assert emergency(one).within_battery is None


def test_in_a_strong_wind_the_farther_zone_downwind_is_reached_sooner() -> None:
    one = hovering((0, 60), (0, -80))
    one.having(wind=wind(0.0, 10.0)).step()
    assert emergency(one).zone_id == 2


def test_without_any_zone_there_is_no_emergency_zone() -> None:
    assert hovering().executive.emergency(hovering().situation()) is None


def test_a_battery_that_does_not_last_is_said() -> None:
    one = hovering((0, 300))
    one.battery_pct = 12.0
    for pct in (12.0, 11.0, 10.0, 9.0):
        one.having(battery_pct=pct).run(5.0)
    assert emergency(one).within_battery is False
