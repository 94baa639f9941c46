"""Precision landing of the simulated PX4, as in navigator/precland.cpp; wind is off."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.px4.px4_modes import Px4Mode
from tests.unit.sitl.autopilot.px4.px4_flight import BODY_FRD, Px4Flight

LANDING, IN_AIR = mavlink.MAV_LANDED_STATE_LANDING, mavlink.MAV_LANDED_STATE_IN_AIR
ON_M = 0.2  # PLD_HACC_RAD


def precland(flight: Px4Flight) -> Px4Flight:
    return flight.enter(Px4Mode.AUTO_PRECLAND)


@pytest.mark.parametrize("away_m", [4.0, 15.0])
def test_it_flies_level_to_the_target_and_sinks_over_it(away_m: float) -> None:
    flight = Px4Flight(7)
    flight.target = (away_m, 0.0)
    precland(flight).until(lambda: LANDING in flight.landed_states())
    assert flight.away_m((away_m, 0)) < ON_M
    assert flight.height_m > 6.5
    assert flight.land().off_m() < ON_M
    assert flight.states[1:] == ["HORIZONTAL_APPROACH", "DESCEND_ABOVE_TARGET"]
    assert flight.landed_states()[:2] == [IN_AIR, LANDING]


def test_a_target_that_moves_in_the_descent_is_followed_while_it_sinks() -> None:
    flight = Px4Flight(6)
    flight.target = (1.0, 0.0)
    precland(flight).below(5)
    flight.target = (3.0, 0.0)
    assert flight.land().off_m() < ON_M


def test_a_target_lost_near_the_ground_is_landed_on() -> None:
    flight = Px4Flight(4)
    flight.target = (1.0, 0.0)
    precland(flight).below(1.4)
    place, flight.target = flight.target, None
    assert flight.land().off_m(place) < ON_M
    assert flight.states[-1] == "FINAL_APPROACH"


def test_a_stream_that_ends_at_seven_metres_costs_a_climb() -> None:
    """Measured on PX4 1.16: it sank to 3.5 m, climbed to 9.7 m and landed in place."""
    flight = Px4Flight(9, MPC_Z_VEL_MAX_DN=1.5, MPC_Z_V_AUTO_UP=3)
    flight.target = (0.1, 0.0)
    precland(flight).below(7)
    flight.target = None
    flight.until(lambda: flight.states[-1] == "SEARCH")
    assert min(flight.heights) == pytest.approx(3.5, abs=0.7)
    before = len(flight.heights)
    flight.land()
    assert max(flight.heights[before:]) == pytest.approx(9.7, abs=0.4)


def test_a_target_lost_above_is_searched_for_and_then_it_lands_in_place() -> None:
    flight = Px4Flight(6, PLD_BTOUT=1, PLD_SRCH_ALT=8, PLD_SRCH_TOUT=4)
    flight.target = (1.0, 0.0)
    precland(flight).below(4)
    place, flight.target = flight.target, None
    flight.until(lambda: flight.states[-1] == "SEARCH")
    lowest_m = min(flight.heights)
    flight.land()
    assert lowest_m > 1.5
    assert max(flight.heights[flight.heights.index(lowest_m) :]) > 7.0
    assert flight.states[2:] == ["DESCEND_ABOVE_TARGET", "START", "SEARCH", "FALLBACK"]
    assert flight.off_m(place) < 0.5


def test_a_target_seen_in_the_search_is_landed_on() -> None:
    flight = Px4Flight(5, PLD_SRCH_ALT=7)
    precland(flight).until(lambda: flight.states[-1] == "SEARCH", 4)
    flight.run(1).target = (2.0, 0.0)
    assert flight.land().off_m() < ON_M
    assert flight.states[3:] == ["HORIZONTAL_APPROACH", "DESCEND_ABOVE_TARGET"]


def test_a_target_lost_too_often_ends_the_search() -> None:
    flight = Px4Flight(5, PLD_BTOUT=0.5, PLD_MAX_SRCH=0)
    flight.target = (0.1, 0.0)
    precland(flight).below(4)
    flight.target = None
    flight.land()
    assert flight.states[-1] == "FALLBACK"
    assert "SEARCH" not in flight.states


def test_without_a_target_it_searches_for_ten_seconds_and_lands_in_place() -> None:
    flight = precland(Px4Flight(5, PLD_SRCH_ALT=7))
    flight.until(lambda: flight.states[-1] == "FALLBACK")
    assert flight.height_m == pytest.approx(7, abs=0.3)
    assert flight.land().off_m((0.0, 0.0)) < 0.2


def test_a_target_in_the_bodys_frame_is_refused_with_a_text_for_each() -> None:
    flight = Px4Flight(3)
    for _ in range(3):
        flight.tell_target(BODY_FRD)
    flight.run(0.1)
    assert flight.texts() == ["Landing target: coordinate frame 12 unsupported\t"] * 3
    assert flight.autopilot.landing_target_enu_m is None


@pytest.mark.parametrize("mode", [Px4Mode.AUTO_LAND, Px4Mode.AUTO_LOITER])
def test_no_other_mode_follows_a_target(mode: Px4Mode) -> None:
    flight = Px4Flight(4)
    flight.target = (3.0, 0.0)
    flight.enter(mode).run(4)
    assert flight.away_m((0, 0)) < 0.2
    if mode is Px4Mode.AUTO_LAND:
        assert flight.land().off_m((0.0, 0.0)) < 0.2
        assert flight.landed_states()[0] in (IN_AIR, LANDING)
