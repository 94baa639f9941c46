"""Wind in a landing: turning into it, the limit for gusts, and room for the drift by gusts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.flight.geometry.wind import Wind
from companion.flight.landing.situation import LandingRequest
from companion.flight.landing.touchdown_heading import touchdown_heading_rad
from companion.flight.landing.wind.landing_wind import FORGET_NS, IntoWind, WindLimit, gust_drift_m
from slz.terrain.footing import ALL_HEADINGS, Footing
from tests.unit.companion.flight.landing.flight import Flight, Phase, zone
from tests.unit.companion.flight.landing.test_touchdown_heading import at, turn_of


def wind(from_deg: float, speed_ms: float = 6.0, gust_ms: float | None = None) -> Wind:
    return Wind(math.radians(from_deg), speed_ms, speed_ms if gust_ms is None else gust_ms, "autopilot")


def heading_deg(into: IntoWind) -> float | None:
    return None if into.heading_rad is None else round(math.degrees(into.heading_rad), 6)


# ---- the heading into the wind -------------------------------------------------------------------


def test_it_begins_at_two_metres_per_second_and_ends_well_below() -> None:
    into = IntoWind()
    seen = []
    for speed in (1.9, 2.0, 1.9, 1.3, 1.1, 1.9):
        into.follow(wind(50, speed))
        seen.append(heading_deg(into))
    assert seen == [None, 50, 50, 50, None, None]


def test_it_follows_a_wind_that_turned_by_more_than_five_degrees() -> None:
    into = IntoWind()
    seen = []
    for direction in (357, 1, 353, 3, 340):
        into.follow(wind(direction))
        seen.append(heading_deg(into))
    assert seen == [357, 357, 357, 3, 340]


def test_frozen_it_stays_whatever_the_wind_does_until_released() -> None:
    into = IntoWind()
    into.follow(wind(100))
    into.freeze(True)
    for blown in (wind(200), wind(100, 0.5), None):
        into.follow(blown)
        assert heading_deg(into) == 100
    into.freeze(False)
    into.follow(wind(200))
    assert heading_deg(into) == 200
    into.follow(None)
    assert heading_deg(into) is None


# ---- among the headings at which the gear stands ---------------------------------------------------


@pytest.mark.parametrize(
    ("headings", "into_deg", "chosen_deg"),
    [((90, 345), 10, 345), ((90, 345), 60, 90), ((0, 180), 100, 180), ((45,), 200, 45)],
)
def test_the_safe_heading_nearest_into_the_wind_is_chosen(
    headings: tuple[int, ...], into_deg: float, chosen_deg: float
) -> None:
    for present_deg in (0, 90, 180, 270):
        wanted = touchdown_heading_rad(at(*headings), math.radians(present_deg), math.radians(into_deg))
        assert wanted is not None
        assert math.degrees(wanted) == pytest.approx(chosen_deg)


def test_where_any_heading_will_do_it_is_exactly_into_the_wind() -> None:
    assert touchdown_heading_rad(at(*ALL_HEADINGS), 1.0, 2.2) == 2.2
    assert touchdown_heading_rad(at(), 1.0, 2.2) is None


def test_of_two_headings_equally_far_from_the_wind_the_nearer_one_is_chosen() -> None:
    for present_deg, chosen_deg in ((20, 0), (160, 180), (340, 0)):
        wanted = touchdown_heading_rad(at(0, 180), math.radians(present_deg), math.radians(90))
        assert wanted is not None
        assert math.degrees(wanted) == pytest.approx(chosen_deg)


# ---- flights ---------------------------------------------------------------------------------------


def test_the_vehicle_turns_into_the_wind_before_it_descends_and_lands_so() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.having(wind=wind(230)).fly_to(Phase.DESCEND)
    assert turn_of(flight) == pytest.approx(230, abs=10)
    flight.fly_to(Phase.LANDED)
    assert turn_of(flight) == pytest.approx(230, abs=2)
    assert flight.executive.tally.aborts == 0


def test_the_gear_goes_before_the_wind() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.having(wind=wind(100), footing=Footing((0, 165))).fly_to(Phase.LANDED)
    assert turn_of(flight) == pytest.approx(165, abs=10)


@pytest.mark.parametrize("settings", [{"into_wind": "off"}, {}])
def test_switched_off_or_in_little_wind_the_heading_is_kept(settings: dict[str, str]) -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5, **settings)
    flight.having(wind=wind(230, 6.0 if settings else 1.5)).fly_to(Phase.DESCEND)
    kept = turn_of(flight)
    assert abs(math.remainder(kept - 230, 360)) > 30
    flight.fly_to(Phase.LANDED)
    assert turn_of(flight) == kept


def test_a_wind_that_turns_during_the_descent_turns_the_vehicle_no_more() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.having(wind=wind(230)).fly_to(Phase.DESCEND)
    flight.having(wind=wind(50)).fly_to(Phase.LANDED)
    assert turn_of(flight) == pytest.approx(230, abs=2)


def test_a_wind_that_never_stops_turning_delays_the_descent_by_no_more_than_a_quarter_minute() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.until(lambda f: f.executive.phase is Phase.APPROACH and np.hypot(*(f.position[:2] - (30, 0))) < 1)
    over_s = flight.time_s
    while flight.executive.phase is Phase.APPROACH:
        flight.wind = wind((40 * flight.time_s) % 360)  # faster than the vehicle turns
        flight.step()
        assert flight.time_s - over_s < 25
    assert flight.executive.phase is Phase.DESCEND
    flight.fly_to(Phase.LANDED)


def test_a_vehicle_that_cannot_turn_descends_after_a_while_and_says_so() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.fly_to(Phase.APPROACH)
    flight.having(wind=wind(180), turns=False, heading_deg=0.0).fly_to(Phase.LANDED)
    assert "SLZ: descending, not into the wind" in flight.texts


def test_turned_into_the_wind_it_says_only_that_it_descends() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.having(wind=wind(180)).fly_to(Phase.DESCEND)
    assert "SLZ: descending" in flight.texts
    assert not any("wind" in text for text in flight.texts)


# ---- gusts beyond the limit --------------------------------------------------

REASON = "wind too strong for this point: 14 m/s"
S = 1_000_000_000


def gust(gust_ms: float) -> Wind:
    return Wind(1.0, 0.7 * gust_ms, gust_ms, "autopilot")


def said(flight: Flight, text: str = REASON) -> int:
    return flight.texts.count(f"SLZ: {text}")


# ---- the limit -------------------------------------------------------------------------------------


def test_it_is_exceeded_above_the_limit_and_kept_only_at_nine_tenths_of_it() -> None:
    limit, seen = WindLimit(), []
    for second, speed in enumerate((11.9, 12.1, 11.0, 10.9, 10.7, 11.9)):
        limit.follow(gust(speed), 12.0, second * S)
        seen.append(limit.gust_ms)
    assert seen == [None, 12.1, 11.0, 10.9, None, None]


def test_an_unknown_wind_exceeds_nothing_and_does_not_lift_the_limit_for_a_minute() -> None:
    limit = WindLimit()
    limit.follow(None, 12.0, 0)
    assert limit.gust_ms is None
    limit.follow(gust(20.0), 12.0, S)
    limit.follow(None, 12.0, S + FORGET_NS)
    assert limit.gust_ms == 20.0
    limit.follow(None, 12.0, S + FORGET_NS + 1)
    assert limit.gust_ms is None


# ---- no landing begins -------------------------------------------------------------------------------


def test_an_automatic_landing_waits_for_less_wind_and_then_begins() -> None:
    flight = Flight([zone(1, 30, 0)])
    flight.having(wind=gust(14.0)).run(65)
    assert flight.phases == [Phase.IDLE]
    assert said(flight) == 3  # each half minute
    flight.having(wind=gust(11.5)).run(10)
    assert flight.phases == [Phase.IDLE]
    flight.having(wind=gust(10.0)).fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


def test_orders_are_refused_with_the_reason_and_an_emergency_lands() -> None:
    flight = Flight([zone(1, 30, 0)], auto=False)
    flight.having(wind=gust(14.0)).run(1)
    s, executive = flight.situation(), flight.executive
    for reply in (
        executive.orders.land_at_best(s),
        executive.orders.land_in_zone(s, 1),
        executive.orders.land_at_point(s, flight.zones[0].best.enu_m),
    ):
        assert (reply.accepted, reply.reason) == (False, REASON)
    assert executive.orders.land_now(s).accepted
    flight.fly_to(Phase.LANDED)
    assert executive.tally.aborts == 0


def test_in_the_survey_it_hovers_and_says_why_and_chooses_when_the_wind_is_less() -> None:
    flight = Flight([zone(1, 30, 0)]).fly_to(Phase.SURVEY)
    flight.having(wind=gust(14.0)).run(400)
    assert flight.phases == [Phase.IDLE, Phase.SURVEY]
    assert flight.velocity @ flight.velocity == 0
    assert said(flight) >= 12
    assert not any("no zone" in text for text in flight.texts)
    flight.having(wind=gust(9.0)).fly_to(Phase.LANDED)


def test_the_search_for_a_zone_has_its_time_after_a_long_wait_for_less_wind() -> None:
    flight = Flight([]).fly_to(Phase.SURVEY)
    flight.having(wind=gust(14.0)).run(400)
    flight.having(wind=gust(9.0)).run(200)
    assert flight.executive.phase is Phase.SURVEY
    assert not any("no zone" in text for text in flight.texts)
    flight.run(150)
    assert "SLZ: no zone found: take over" in flight.texts


# ---- a landing is broken off ---------------------------------------------------------------------------


@pytest.mark.parametrize("phase", [Phase.APPROACH, Phase.DESCEND, Phase.FINAL])
def test_it_breaks_off_climbs_and_lands_at_the_same_point_when_the_wind_is_less(phase: Phase) -> None:
    flight = Flight([zone(1, 30, 0)]).fly_to(phase)
    flight.having(wind=gust(14.0)).step()
    assert flight.executive.phase is Phase.CLIMB
    assert flight.executive.tally.abort_reasons == [REASON]
    assert said(flight, f"abort: {REASON}") == 1
    assert len(f"SLZ: abort: {REASON}") <= 50
    flight.run(60)
    assert flight.mode == "GUIDED"
    assert flight.executive.phase is Phase.SURVEY
    flight.having(wind=gust(10.0)).fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 1
    assert flight.position[0] == pytest.approx(30, abs=1)


def test_a_point_that_was_ordered_is_still_the_one_flown_to_afterwards() -> None:
    flight = Flight([zone(1, 30, 0), zone(2, -30, 0)], auto=False)
    flight.run(1)
    assert flight.executive.orders.land_in_zone(flight.situation(), 2).accepted
    flight.fly_to(Phase.DESCEND)
    flight.having(wind=gust(14.0)).run(40)
    flight.having(wind=None).run(61)
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(-30, abs=1)


def test_below_the_commit_height_it_lands_in_any_wind() -> None:
    flight = Flight([zone(1, 30, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < f.parameters.commit_height_m)
    flight.having(wind=gust(30.0)).fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


def test_an_emergency_and_a_low_battery_land_in_any_wind() -> None:
    urgent = Flight([zone(1, 30, 0)], auto=False)
    urgent.run(1)
    assert urgent.executive.orders.land_now(urgent.situation()).accepted
    urgent.fly_to(Phase.APPROACH).wind = gust(30.0)
    empty = Flight([zone(1, 30, 0)]).having(wind=gust(30.0), battery_pct=10.0)
    for flight in (urgent, empty):
        flight.fly_to(Phase.LANDED)
        assert flight.executive.tally.aborts == 0
    assert empty.executive.progress.request in (None, LandingRequest(urgent=True))


def test_the_limit_is_a_parameter_and_an_unknown_wind_changes_nothing() -> None:
    windy = Flight([zone(1, 30, 0)], max_wind_ms=20.0)
    windy.wind = gust(14.0)
    unknown = Flight([zone(1, 30, 0)])
    for flight in (windy, unknown):
        flight.fly_to(Phase.LANDED)
        assert not any("wind" in text for text in flight.texts)


# ---- drift by gusts --------------------------------------------------

GUSTY = Wind(0.0, 5.0, 11.0, "autopilot")


def test_the_drift_is_a_tenth_of_a_second_of_what_gusts_exceed_the_mean() -> None:
    assert gust_drift_m(GUSTY) == pytest.approx(0.6)
    assert gust_drift_m(Wind(0.0, 5.0, 5.0, "tilt")) == 0.0
    assert gust_drift_m(None) == 0.0


@pytest.mark.parametrize(("wind", "east_m"), [(GUSTY, -30), (None, 30)])
def test_in_gusts_a_zone_without_room_for_the_drift_is_passed_over(wind: Wind | None, east_m: float) -> None:
    flight = Flight([zone(1, 30, 0, clearance=1.0), zone(2, -30, 0, clearance=1.2)])
    flight.having(wind=wind).fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(east_m, abs=1)


def test_an_ordered_zone_is_landed_in_all_the_same() -> None:
    flight = Flight([zone(1, 30, 0, clearance=1.0)], auto=False)
    flight.having(wind=GUSTY).run(1)
    assert flight.executive.orders.land_in_zone(flight.situation(), 1).accepted
    flight.fly_to(Phase.LANDED)
