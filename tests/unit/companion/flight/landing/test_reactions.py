"""Vehicles that do not obey, obstacles in the way, and dust."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.landing.situation import Phase
from slz import PointState
from tests.unit.companion.flight.landing.flight import Flight, zone


def test_a_landing_that_does_not_sink_is_broken_off() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.having(sinks=False).fly_to(Phase.CLIMB)
    assert flight.executive.tally.abort_reasons == ["does not land"]
    assert flight.mode == "GUIDED"


def test_a_landing_that_hangs_below_commit_height_calls_the_pilot() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 1.0)
    flight.having(sinks=False).run(150)
    assert flight.executive.phase is Phase.FINAL
    assert 1 <= sum("not landing: take over" in text for text in flight.texts) <= 3


def test_a_vehicle_that_does_not_climb_calls_the_pilot_and_is_asked_on() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.state = lambda _height, _point: PointState.UNSAFE
    flight.sinks = flight.obeys = False
    flight.run(150)
    assert flight.executive.phase is Phase.HOLD  # who called the pilot begins nothing afterwards
    assert 1 <= sum("not climbing: take over" in text for text in flight.texts) <= 3
    assert flight.commands[-1][3].mode == "guided"


def test_a_vehicle_pressed_down_while_it_holds_is_given_its_time_to_climb() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.APPROACH)
    flight.having(lidar_ok=False).fly_to(Phase.HOLD).run(100)

    def pressed_down(seconds: int) -> bool:
        for _ in range(10 * seconds):
            flight.step()
            flight.position[2] = 25.0
        return any("not climbing: take over" in text for text in flight.texts)

    assert not pressed_down(55)
    assert pressed_down(20)


def test_below_the_dust_height_nothing_is_mapped_and_the_last_state_holds() -> None:
    flight = Flight([zone(1, 10, 0)], dust_height_m=4.0)
    flight.state = lambda h, _point: PointState.UNSAFE if h < 3.8 else PointState.SAFE
    mapped = []
    while flight.executive.phase is not Phase.LANDED:
        flight.step()
        mapped.append((flight.position[2], flight.executive.mapping))
    assert flight.executive.tally.aborts == 0
    assert {on for height, on in mapped if height > 4.3} == {True}
    assert {on for height, on in mapped if height < 3.8} == {False}


def test_after_a_landing_mapping_begins_again_with_the_next_flight() -> None:
    flight = Flight([zone(1, 0, 0)]).fly_to(Phase.LANDED)
    assert not flight.executive.mapping
    flight.mode, flight.position[2], flight.velocity = "GUIDED", 20.0, np.zeros(3)
    flight.fly_to(Phase.SURVEY)
    assert flight.executive.mapping


def test_below_the_point_of_the_landing_before_the_next_flight_is_mapped() -> None:
    """From a roof or a hill down, before any order."""
    flight = Flight([zone(1, 0, 0)]).fly_to(Phase.LANDED)
    flight.mode, flight.position = "LOITER", np.array([60.0, 0.0, 15.0])
    flight.having(estimate_is_off_m=np.array([0.0, 0.0, -25.0])).run(1)
    assert flight.executive.phase is Phase.LANDED
    assert flight.executive.mapping


def test_it_climbs_over_what_is_in_the_way() -> None:
    flight = Flight([zone(1, 40, 0)])
    flight.having(blocked=lambda f: 15 < f.position[0] < 25 and f.position[2] < 41).fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0
    assert any("obstacle ahead: climbing" in text for text in flight.texts)


def test_what_is_too_high_to_pass_over_costs_the_point() -> None:
    flight = Flight([zone(1, 40, 0), zone(2, -30, 0)])
    flight.having(blocked=lambda f: f.position[0] > 15 and f.velocity_wanted[0] > 0).fly_to(Phase.LANDED)
    assert flight.executive.tally.abort_reasons == ["way blocked"]
    assert flight.position[0] == pytest.approx(-30, abs=0.5)


def test_a_point_that_is_not_reached_is_given_up() -> None:
    flight = Flight([zone(1, 40, 0), zone(2, -30, 0)])
    head_wind = Flight.step

    def held(f: Flight) -> None:
        head_wind(f)
        f.position[0] = min(f.position[0], 20.0)

    while "point not reached" not in flight.executive.tally.abort_reasons:
        held(flight)
        assert flight.time_s < 200
    assert flight.executive.phase is Phase.CLIMB
