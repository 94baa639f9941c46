"""Landings along an approach path: out from over the point, in, and what breaks them off."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from companion.flight.geometry.wind import Wind
from companion.flight.landing.situation import Phase
from slz import SAFE, UNKNOWN, UNSAFE, Corridors, PointState, Wire
from slz.wires.detected_wire import SaggingCurve
from tests.unit.companion.flight.landing.flight import Flight, zone
from tests.unit.companion.flight.landing.ways.corridors import made

SLOPED: dict[str, Any] = {"approach_path": "sloped", "corridor_m": 100.0, "zone_m": 400.0}


def flight(corridors: Corridors | None, **settings: Any) -> Flight:
    one = Flight([zone(1, 0, 0)], height=20.0, **{**SLOPED, **settings})
    one.corridors = lambda _flight: corridors
    return one


def track(one: Flight, phase: Phase) -> np.ndarray:
    """Fly until landed; return the positions (n, 3) in a phase."""
    places = []

    def landed(f: Flight) -> bool:
        if f.executive.phase is phase:
            places.append(f.position.copy())
        return f.executive.phase is Phase.FINAL and f.position[2] < 0.1

    one.until(landed)
    return np.array(places)


def test_the_vehicle_comes_in_along_the_clear_corridor() -> None:
    one = flight(made({(90, 10.0): int(SAFE)}, all_of=int(UNSAFE)))
    one.corridors = lambda _flight: made({(90, 10.0): int(SAFE)}, all_of=int(UNSAFE))
    places = track(one, Phase.DESCEND)
    assert places[0, 0] > 80
    assert np.abs(places[:, 1]).max() < 1.0
    assert np.all(np.diff(places[:, 2]) <= 0.05)
    inward = places[places[:, 0] > 20]
    on_path = 3.5 + np.tan(np.radians(10)) * inward[:, 0]
    assert np.abs(inward[:, 2] - on_path).max() < 1.5
    assert places[-1, 2] < 5


def test_the_time_told_is_that_of_the_path() -> None:
    one = flight(made({(90, 10.0): int(SAFE)}, all_of=int(UNSAFE)))
    told: list[tuple[float, int]] = []

    def lands(f: Flight) -> bool:
        if f.executive.phase is Phase.DESCEND and f.position[0] < 60:
            words = f.executive.outlook(f.situation()).doing
            told.append((f.time_s, int(words.removeprefix("LAND in ").partition(" ")[0])))
        return f.executive.phase is Phase.FINAL

    one.until(lands)
    begun_s, seconds = told[0]
    assert seconds > 10
    assert abs(one.time_s - begun_s - seconds) < 0.25 * seconds


def test_the_nose_is_on_the_course_and_the_landing_target_streamed_at_the_end() -> None:
    one = flight(made({(90, 10.0): int(SAFE)}, all_of=int(UNSAFE)))
    track(one, Phase.DESCEND)
    inward = [c for _, phase, _, c in one.commands if phase is Phase.DESCEND]
    assert math.degrees(inward[5].yaw_rad or 0.0) % 360 == 270
    assert inward[5].target_enu_m is None
    assert sum(c.target_enu_m is not None for c in inward) > 25


def test_it_comes_in_against_the_wind() -> None:
    one = flight(made())
    one.wind = Wind(math.radians(40.0), 6.0, 7.0, "autopilot")
    places = track(one, Phase.DESCEND)
    bearing_deg = math.degrees(math.atan2(places[0, 0], places[0, 1])) % 360
    assert abs(bearing_deg - 220) <= 15


def test_a_corridor_not_seen_yet_is_seen_on_the_way_out() -> None:
    def corridors(f: Flight) -> Corridors:
        seen = np.hypot(*f.position[:2]) > 40
        return made(all_of=int(SAFE if seen else UNKNOWN))

    one = flight(None)
    one.corridors = corridors
    assert track(one, Phase.DESCEND)[0, :2].max() < 101
    assert any("flying out" in text for text in one.texts)
    assert any("way in from" in text for text in one.texts)


def test_air_that_stays_unseen_is_not_flown_through() -> None:
    one = flight(made({(0, 90.0): int(UNKNOWN)}, all_of=int(UNKNOWN)))
    places = track(one, Phase.DESCEND)
    assert np.hypot(places[:, 0], places[:, 1]).max() < 2
    assert sum("flying out" in text for text in one.texts) == 3
    assert any("no clear way in: straight down" in text for text in one.texts)


def test_what_enters_the_way_in_breaks_the_landing_off() -> None:
    one = flight(made())
    one.fly_to(Phase.DESCEND).run(5)
    one.having(corridors=lambda _flight: made(all_of=int(UNSAFE))).fly_to(Phase.CLIMB)
    assert any("abort: way in blocked" in text for text in one.texts)


def test_something_ahead_breaks_the_landing_off_after_a_second() -> None:
    one = flight(made())
    one.fly_to(Phase.DESCEND).run(3)
    one.having(blocked=lambda _flight: True).run(0.5)
    assert one.executive.phase is Phase.DESCEND
    one.run(1.5)
    assert one.executive.phase is Phase.CLIMB


def test_a_multirotor_goes_straight_down_where_that_is_clear() -> None:
    one = flight(made(), approach_path="vertical")
    places = track(one, Phase.DESCEND)
    assert np.hypot(places[:, 0], places[:, 1]).max() < 2


def test_where_straight_down_is_blocked_it_takes_a_clear_way_aside() -> None:
    states = {(180, 30.0): int(SAFE)}
    one = flight(made(states, all_of=int(UNSAFE)), approach_path="vertical")
    assert track(one, Phase.DESCEND)[0, 1] < -20


def test_a_point_without_any_way_in_is_refused() -> None:
    one = flight(made(all_of=int(UNSAFE)))
    one.fly_to(Phase.CLIMB)
    assert any("abort: no way in" in text for text in one.texts)


def test_what_comes_beside_the_point_breaks_a_vertical_descent_off() -> None:
    one = flight(made(), approach_path="vertical")
    one.fly_to(Phase.DESCEND).run(2)
    one.having(corridors=lambda _flight: made({(0, 90.0): int(UNSAFE)})).fly_to(Phase.CLIMB)
    assert any("abort: way in blocked" in text for text in one.texts)


def test_an_urgent_landing_goes_straight_down() -> None:
    one = flight(made(), battery_land_pct=30.0)
    one.battery_pct = 20.0
    assert np.hypot(*track(one, Phase.DESCEND)[0, :2]) < 2


def test_what_comes_beside_the_point_breaks_the_autopilot_s_landing_off() -> None:
    one = flight(made(), approach_path="vertical")
    one.fly_to(Phase.FINAL).run(1)
    assert one.position[2] > 5
    one.having(corridors=lambda _flight: made({(0, 90.0): int(UNSAFE)})).fly_to(Phase.CLIMB)
    assert any("abort: way in blocked" in text for text in one.texts)


def test_a_battery_that_becomes_low_on_the_way_out_brings_it_back_and_straight_down() -> None:
    one = flight(made({(90, 10.0): int(SAFE)}, all_of=int(UNKNOWN)), battery_land_pct=30.0)
    one.until(lambda f: any("flying out" in text for text in f.texts))
    one.battery_pct = 20.0
    places = track(one, Phase.DESCEND)
    assert np.hypot(places[:, 0], places[:, 1]).max() < 2


def test_a_wire_over_the_point_is_named_as_the_reason() -> None:
    across = SaggingCurve(
        np.array([-20.0, 1.0]), np.array([1.0, 0.0]), np.array([9.0, 0.0, 0.002]), np.eye(3) * 1e-4, 0.1, 1.0
    )
    one = Flight([zone(1, 0, 0)], height=20.0)
    one.fly_to(Phase.DESCEND)
    one.wires = (Wire(1, across, 0.0, 40.0, 0.0, 40.0, (False, False), 50, 1, 2),)
    one.having(state=lambda _height, _point: PointState.UNSAFE).fly_to(Phase.CLIMB)
    assert one.executive.tally.abort_reasons == ["point unsafe: wire"]
