"""Low battery: land at the zone reached soonest, and call the pilot while there is none."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.landing.situation import Phase
from tests.unit.companion.flight.landing.flight import Flight, replace, zone

NO_ZONE = "SLZ: battery low, no zone: take over"
NEAR = zone(2, -8, 0)


def warnings(flight: Flight) -> int:
    return sum("battery low" in text for text in flight.texts)


@pytest.mark.parametrize(
    ("zones", "survey_s", "phase", "lands_at_m"),
    [
        ([zone(1, 90, 0, clearance=9), NEAR], 600.0, Phase.SURVEY, -8),
        ([zone(1, 190, 0, clearance=9), NEAR], 5.0, Phase.APPROACH, -8),
        ([zone(1, 20, 0, clearance=9), zone(2, -80, 0)], 5.0, Phase.APPROACH, 20),
    ],
    ids=["at once", "it turns back", "the point is the nearest"],
)
def test_a_low_battery_lands_at_the_nearest_zone(
    zones: list, survey_s: float, phase: Phase, lands_at_m: float
) -> None:
    flight = Flight(zones, survey_s=survey_s).fly_to(phase).run(2)
    flight.having(battery_pct=14.0).fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(lands_at_m, abs=0.5)
    assert flight.phases.count(Phase.SURVEY) == 1
    assert warnings(flight) == 1
    assert flight.executive.tally.aborts == 0
    assert flight.time_s < 120


@pytest.mark.parametrize("auto", [True, False])
def test_a_hand_over_with_a_low_battery_lands_at_the_nearest_zone_at_once(auto: bool) -> None:
    flight = Flight([zone(1, 90, 0, clearance=9), NEAR], auto=auto, survey_s=600.0)
    flight.having(battery_pct=14.0).run(1)
    if not auto:
        flight.executive.orders.land_at_best(flight.situation())
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(-8, abs=0.5)


@pytest.mark.parametrize(
    ("charges", "settings", "armed", "height_m", "said"),
    [
        ((0.0,), {"battery_land_pct": 0.0}, True, 30.0, 0),
        ((10.0,), {}, True, 30.0, 1),
        ((5.0,), {}, False, 0.0, 0),
        ((10.0, 14.0, 90.0, 12.0), {}, True, 30.0, 2),
    ],
    ids=["never low", "low", "on the ground", "a new battery is watched anew"],
)
def test_before_the_hand_over_a_low_battery_is_said_once_and_commands_nothing(
    charges: tuple, settings: dict, armed: bool, height_m: float, said: int
) -> None:
    flight = Flight([zone(1, 0, 0)], auto=False, height=height_m, **settings).having(armed=armed)
    for flight.battery_pct in charges:
        assert flight.silent_for(8)
    assert warnings(flight) == len(flight.texts) == said


@pytest.mark.parametrize("phase", [Phase.DESCEND, Phase.FINAL])
def test_a_low_battery_in_its_own_landing_is_not_told_to_land(phase: Phase) -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(phase)
    flight.having(battery_pct=10.0).fly_to(Phase.LANDED)
    assert warnings(flight) == 0


def test_after_the_operator_s_abort_a_battery_low_since_the_descent_is_told_and_nothing_begins() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.DESCEND)
    flight.having(battery_pct=10.0).run(1)
    flight.executive.orders.abort(flight.situation())
    flight.run(60)
    assert flight.executive.phase is Phase.HOLD
    assert warnings(flight) == 1


def test_a_battery_low_since_the_ground_is_told_in_the_air() -> None:
    flight = Flight([zone(1, 10, 0)], auto=False, height=0.0)
    assert flight.having(battery_pct=10.0).run(2).texts == []
    assert flight.having(position=np.array([0.0, 0.0, 15.0])).run(2).texts == ["SLZ: battery low: land"]


@pytest.mark.parametrize("mapped", [True, False])
def test_a_low_battery_without_a_zone_or_a_map_goes_on_to_the_point_that_was_chosen(mapped: bool) -> None:
    flight = Flight([zone(1, 60, 0)]).fly_to(Phase.APPROACH).having(battery_pct=5.0)
    if mapped:
        flight.zones = []
    else:
        commands = flight.executive.step(replace(flight.situation(), report=None))
        assert [text for _, text in commands.texts] == ["SLZ: battery low: landing at the nearest zone"]
        assert flight.executive.phase is Phase.APPROACH
    flight.fly_to(Phase.LANDED)
    assert flight.phases.count(Phase.APPROACH) == 1
    assert flight.position[0] == pytest.approx(60, abs=0.5)


@pytest.mark.parametrize("auto", [True, False])
def test_a_low_battery_without_a_zone_calls_the_pilot_again_and_again(auto: bool) -> None:
    flight = Flight([], auto=auto).run(1)
    if not auto:
        flight.executive.orders.land_at_best(flight.situation())
    flight.fly_to(Phase.SURVEY).run(20)
    flight.having(battery_pct=14.0).run(1)
    assert flight.texts[-1] == NO_ZONE
    assert flight.severities[-1].name == "CRITICAL"
    flight.run(120)
    assert 4 <= flight.texts.count(NO_ZONE) <= 5
    said = flight.fly_to(Phase.HOLD).texts.count(NO_ZONE)
    assert flight.run(120).texts.count(NO_ZONE) > said + 2
    assert not any("landing at the nearest" in text for text in flight.texts)


def test_a_low_battery_lands_at_the_zone_found_after_the_pilot_was_called() -> None:
    flight = Flight([]).fly_to(Phase.SURVEY).run(20)
    flight.having(battery_pct=14.0).run(40)
    flight.zones.append(zone(1, 30, 0))
    flight.fly_to(Phase.LANDED)
    assert flight.texts.count(NO_ZONE) == 2
