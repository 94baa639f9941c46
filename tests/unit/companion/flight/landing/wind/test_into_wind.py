"""Turning into the wind before a descent."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.flight.geometry.wind import Wind
from companion.flight.landing.landing_wind import IntoWind
from companion.flight.landing.touchdown_heading import touchdown_heading_rad
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
    flight.wind = wind(230)
    flight.fly_to(Phase.DESCEND)
    assert turn_of(flight) == pytest.approx(230, abs=10)
    flight.fly_to(Phase.LANDED)
    assert turn_of(flight) == pytest.approx(230, abs=2)
    assert flight.executive.tally.aborts == 0


def test_the_gear_goes_before_the_wind() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.wind, flight.footing = wind(100), Footing((0, 165))
    flight.fly_to(Phase.LANDED)
    assert turn_of(flight) == pytest.approx(165, abs=10)


@pytest.mark.parametrize("settings", [{"into_wind": "off"}, {}])
def test_switched_off_or_in_little_wind_the_heading_is_kept(settings: dict[str, str]) -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5, **settings)
    flight.wind = wind(230, 6.0 if settings else 1.5)
    flight.fly_to(Phase.DESCEND)
    kept = turn_of(flight)
    assert abs(math.remainder(kept - 230, 360)) > 30
    flight.fly_to(Phase.LANDED)
    assert turn_of(flight) == kept


def test_a_wind_that_turns_during_the_descent_turns_the_vehicle_no_more() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.wind = wind(230)
    flight.fly_to(Phase.DESCEND)
    flight.wind = wind(50)
    flight.fly_to(Phase.LANDED)
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
    flight.wind, flight.turns, flight.heading_deg = wind(180), False, 0.0
    flight.fly_to(Phase.LANDED)
    assert "SLZ: descending, not into the wind" in flight.texts


def test_turned_into_the_wind_it_says_only_that_it_descends() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.wind = wind(180)
    flight.fly_to(Phase.DESCEND)
    assert "SLZ: descending" in flight.texts
    assert not any("wind" in text for text in flight.texts)
