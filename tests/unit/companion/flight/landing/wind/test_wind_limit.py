"""Landings in too much wind: refused, broken off before the commit height, and begun again."""

from __future__ import annotations

import pytest

from companion.flight.geometry.wind import Wind
from companion.flight.landing.landing_wind import FORGET_NS, WindLimit
from companion.flight.landing.situation import LandingRequest
from tests.unit.companion.flight.landing.flight import Flight, Phase, zone

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
    flight.wind = gust(14.0)
    flight.run(65)
    assert flight.phases == [Phase.IDLE]
    assert said(flight) == 3  # each half minute
    flight.wind = gust(11.5)
    flight.run(10)
    assert flight.phases == [Phase.IDLE]
    flight.wind = gust(10.0)
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


def test_orders_are_refused_with_the_reason_and_an_emergency_lands() -> None:
    flight = Flight([zone(1, 30, 0)], auto=False)
    flight.wind = gust(14.0)
    flight.run(1)
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
    flight.wind = gust(14.0)
    flight.run(400)
    assert flight.phases == [Phase.IDLE, Phase.SURVEY]
    assert flight.velocity @ flight.velocity == 0
    assert said(flight) >= 12
    assert not any("no zone" in text for text in flight.texts)
    flight.wind = gust(9.0)
    flight.fly_to(Phase.LANDED)


def test_the_search_for_a_zone_has_its_time_after_a_long_wait_for_less_wind() -> None:
    flight = Flight([]).fly_to(Phase.SURVEY)
    flight.wind = gust(14.0)
    flight.run(400)
    flight.wind = gust(9.0)
    flight.run(200)
    assert flight.executive.phase is Phase.SURVEY
    assert not any("no zone" in text for text in flight.texts)
    flight.run(150)
    assert "SLZ: no zone found: take over" in flight.texts


# ---- a landing is broken off ---------------------------------------------------------------------------


@pytest.mark.parametrize("phase", [Phase.APPROACH, Phase.DESCEND, Phase.FINAL])
def test_it_breaks_off_climbs_and_lands_at_the_same_point_when_the_wind_is_less(phase: Phase) -> None:
    flight = Flight([zone(1, 30, 0)]).fly_to(phase)
    flight.wind = gust(14.0)
    flight.step()
    assert flight.executive.phase is Phase.CLIMB
    assert flight.executive.tally.abort_reasons == [REASON]
    assert said(flight, f"abort: {REASON}") == 1
    assert len(f"SLZ: abort: {REASON}") <= 50
    flight.run(60)
    assert flight.mode == "GUIDED"
    assert flight.executive.phase is Phase.SURVEY
    flight.wind = gust(10.0)
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 1
    assert flight.position[0] == pytest.approx(30, abs=1)


def test_a_point_that_was_ordered_is_still_the_one_flown_to_afterwards() -> None:
    flight = Flight([zone(1, 30, 0), zone(2, -30, 0)], auto=False)
    flight.run(1)
    assert flight.executive.orders.land_in_zone(flight.situation(), 2).accepted
    flight.fly_to(Phase.DESCEND)
    flight.wind = gust(14.0)
    flight.run(40)
    flight.wind = None
    flight.run(61)
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(-30, abs=1)


def test_below_the_commit_height_it_lands_in_any_wind() -> None:
    flight = Flight([zone(1, 30, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < f.parameters.commit_height_m)
    flight.wind = gust(30.0)
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


def test_an_emergency_and_a_low_battery_land_in_any_wind() -> None:
    urgent = Flight([zone(1, 30, 0)], auto=False)
    urgent.run(1)
    assert urgent.executive.orders.land_now(urgent.situation()).accepted
    urgent.fly_to(Phase.APPROACH).wind = gust(30.0)
    empty = Flight([zone(1, 30, 0)])
    empty.wind, empty.battery_pct = gust(30.0), 10.0
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
