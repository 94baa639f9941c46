"""Landing at a heading at which the gear stands, and the closer look before it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from companion.flight.landing.touchdown_heading import stands_at, touchdown_heading_rad
from slz import PointState, SelectedPoint
from slz.terrain.footing import ALL_HEADINGS, ANY_FOOTING, Footing
from tests.unit.companion.flight.landing.flight import Flight, Phase, zone


def at(*headings_deg: int, unseen: float = math.nan) -> SelectedPoint:
    footing = Footing(headings_deg, unseen)
    return SelectedPoint(np.zeros(3), PointState.SAFE, "near", 0.0, 1.0, 0.05, 0.99, 1, None, footing)


def turn_of(flight: Flight) -> float:
    assert flight.heading_deg is not None
    return flight.heading_deg % 360


@pytest.mark.parametrize(
    ("present_deg", "chosen_deg"), [(0, 345), (80, 90), (170, 90), (300, 345), (350, 345)]
)
def test_the_nearest_safe_heading_is_chosen(present_deg: float, chosen_deg: float) -> None:
    wanted = touchdown_heading_rad(at(90, 345), math.radians(present_deg))
    assert wanted is not None
    assert math.degrees(wanted) % 360 == pytest.approx(chosen_deg)


def test_without_a_point_or_with_every_heading_safe_the_heading_is_kept() -> None:
    assert touchdown_heading_rad(None, 1.0) is None
    assert touchdown_heading_rad(at(*ALL_HEADINGS), 1.0) is None
    assert stands_at(at(*ALL_HEADINGS), None)


def test_an_unknown_heading_is_not_one_at_which_the_gear_stands() -> None:
    assert not stands_at(at(90), None)
    assert stands_at(at(90), math.radians(97))
    assert not stands_at(at(90), math.radians(110))
    assert stands_at(at(0), math.radians(355))


def test_the_vehicle_turns_before_it_descends_and_lands_at_that_heading() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.having(footing=Footing((135, 315))).fly_to(Phase.DESCEND)
    assert min(abs(turn_of(flight) - 135), abs(turn_of(flight) - 315)) < 10
    flight.fly_to(Phase.LANDED)


def test_a_vehicle_that_does_not_turn_does_not_descend() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.fly_to(Phase.APPROACH)
    flight.having(turns=False, heading_deg=0.0, footing=Footing((90, 270))).run(60)
    assert Phase.DESCEND not in flight.phases


def test_sinking_waits_while_the_gear_would_not_stand() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5).fly_to(Phase.DESCEND)
    flight.run(2)
    flight.turns, flight.heading_deg = False, 0.0
    flight.footing = Footing((90,))
    height = flight.position[2]
    flight.run(3)
    assert flight.position[2] > height - 0.5
    flight.having(turns=True).fly_to(Phase.LANDED)
    assert turn_of(flight) == pytest.approx(90, abs=10)


def test_a_vehicle_turned_away_in_the_autopilots_landing_breaks_off() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.having(footing=Footing((90,))).fly_to(Phase.FINAL)
    flight.having(heading_deg=130.0).fly_to(Phase.CLIMB)
    assert flight.executive.tally.abort_reasons == ["heading unsafe"]


# ---- closer look ---------------------------------------------------------------------------------


def test_the_vehicle_circles_the_point_until_hazards_there_would_have_been_seen() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5).having(footing=Footing(unseen=0.2))
    flight.fly_to(Phase.APPROACH).until(lambda f: any("looking closer" in text for text in f.texts))
    flight.run(8)
    track = np.array([flight.position[:2]])
    for _ in range(8):
        track = np.vstack([track, flight.run(1).position[:2]])
    assert np.ptp(track, axis=0).min() > 1.5
    assert Phase.DESCEND not in flight.phases
    flight.having(footing=Footing(unseen=0.005)).fly_to(Phase.LANDED)


def test_a_look_ends_after_a_while_and_says_what_stays_unseen() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.having(footing=Footing(unseen=0.2)).fly_to(Phase.LANDED)
    assert any("20% of 0.3 m hazards stay unseen" in text for text in flight.texts)


@pytest.mark.parametrize("footing", [ANY_FOOTING, Footing(unseen=0.0)])
def test_ground_well_seen_or_without_evidence_of_cells_takes_no_look(footing: Footing) -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5)
    flight.having(footing=footing).fly_to(Phase.LANDED)
    assert not any("hazards" in text for text in flight.texts)


def test_a_look_into_blocked_air_ends_without_a_climb_and_the_landing_goes_on() -> None:
    flight = Flight([zone(1, 30, 0)], survey_s=5).having(footing=Footing(unseen=0.2))
    flight.having(blocked=lambda f: f.position[1] > 0.2 and f.velocity_wanted[1] > 0.2).fly_to(Phase.LANDED)
    assert not any("climbing" in text for text in flight.texts)
    assert flight.executive.tally.abort_reasons == []


def test_no_heading_at_all_is_none_at_which_the_gear_stands() -> None:
    assert not stands_at(at(), 0.0)
