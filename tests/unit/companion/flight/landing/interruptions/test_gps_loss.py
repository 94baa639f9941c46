"""Loss of GPS in each phase: the estimate lives on for some seconds, so nothing climbs or flies aside."""

import numpy as np
import pytest

from companion.flight.landing.situation import Phase
from slz import Intrusion, PointState
from tests.unit.companion.flight.landing.flight import GUIDED_PHASES, Flight, flown_to, zone

AT_ONCE, HOVERING = "SLZ: GPS lost: landing at once, be ready", "SLZ: GPS lost: hovering, be ready"
UNSAFE = PointState.UNSAFE


def stays(flight: Flight, seconds: float) -> bool:
    """Fly on; return whether the vehicle neither climbs nor flies aside."""
    before = flight.position.copy()
    for _ in range(round(seconds * 10)):
        flight.step()
        moved = flight.position - before
        if moved[2] > 0.05 or np.hypot(*moved[:2]) > 0.3:
            return False
    return True


@pytest.mark.parametrize("phase", [Phase.SURVEY, Phase.APPROACH, Phase.CLIMB, Phase.HOLD])
@pytest.mark.parametrize("tracked", [None, False, True])
def test_without_gps_a_vehicle_that_does_not_descend_hovers_where_it_is(
    phase: Phase, tracked: bool | None
) -> None:
    flight = flown_to(phase, odometry="off" if tracked is None else "map")
    if phase is Phase.APPROACH:  # otherwise it is over the safe point
        flight.having(state=lambda _height, _point: PointState.UNKNOWN).run(1)
    flight.having(gps_lost=True, tracked=tracked).run(0.8)
    assert stays(flight, 6)
    assert [text for text in flight.texts if "GPS" in text] == [HOVERING]
    assert flight.executive.phase is phase
    assert flight.mode == "GUIDED"


def test_a_survey_goes_on_when_gps_has_been_back_for_five_seconds() -> None:
    flight = flown_to(Phase.SURVEY)
    flight.having(gps_lost=True).run(2)
    flight.gps_lost = False
    assert stays(flight, 4.5)
    flight.fly_to(Phase.LANDED)


def test_a_single_report_without_a_fix_changes_nothing() -> None:
    flight = flown_to(Phase.DESCEND)
    flight.having(gps_lost=True).run(0.4)
    flight.having(gps_lost=False, state=lambda _height, _point: UNSAFE).run(0.3)
    assert flight.executive.phase is Phase.CLIMB
    assert not any("GPS" in text for text in flight.texts)


def test_over_the_safe_point_it_lands_at_once() -> None:
    flight = flown_to(Phase.APPROACH)
    flight.until(lambda f: f.executive.progress.safe_since_ns is not None)
    flight.having(gps_lost=True).run(0.8)
    assert flight.executive.phase is Phase.DESCEND
    flight.fly_to(Phase.LANDED)
    assert [text for text in flight.texts if "GPS" in text] == [AT_ONCE]


@pytest.mark.parametrize("judged", [PointState.UNSAFE, PointState.UNKNOWN])
@pytest.mark.parametrize("phase", [Phase.DESCEND, Phase.FINAL])
def test_a_landing_without_gps_goes_on_whatever_the_drifting_map_shows(
    phase: Phase, judged: PointState
) -> None:
    flight = flown_to(phase)
    flight.having(gps_lost=True).run(0.2)
    flight.state = lambda _height, _point: judged
    flight.lidar_ok = False
    flight.push = np.array([0.05, 0.0, 0.0])  # the estimate drifts
    assert stays(flight, 3.0)
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0
    assert [text for text in flight.texts if "GPS" in text] == [AT_ONCE]


def test_a_descent_without_gps_sinks_on_and_lands_before_the_estimate_fails() -> None:
    flight = flown_to(Phase.DESCEND, final_height_m=20.0)
    flight.until(lambda f: f.position[2] < 24)
    flight.gps_lost, begun_s = True, flight.time_s
    flight.fly_to(Phase.FINAL)
    assert 5.0 <= flight.time_s - begun_s < 5.5
    assert flight.position[2] < 20 - 1.0


def test_a_low_descent_without_gps_is_not_left_to_the_slow_landing_mode_before_commit_height() -> None:
    flight = Flight([zone(1, 20, 0)], final_height_m=10.0).fly_to(Phase.DESCEND)
    flight.until(lambda f: f.position[2] < 10.5)
    flight.having(gps_lost=True).until(lambda f: f.mode == "LAND")
    assert flight.position[2] < 5


def test_in_gusts_a_landing_without_gps_goes_on() -> None:
    flight = flown_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 9)
    flight.having(gps_lost=True, push=np.array([0.9, 0.0, 0.0])).fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


@pytest.mark.parametrize("phase", [Phase.DESCEND, Phase.FINAL])
def test_over_an_object_that_came_the_vehicle_hovers_and_calls_and_begins_nothing(phase: Phase) -> None:
    flight = flown_to(phase)
    flight.until(lambda f: f.position[2] < 9 or phase is Phase.DESCEND)
    flight.having(gps_lost=True).run(0.8)
    flight.having(intrusion=Intrusion(1.6, np.array([20.0, 0.0, 1.6]), 0, 0)).run(0.2)
    assert stays(flight, 4)
    assert flight.texts[-1] == "SLZ: abort: object of 1.6 m came"
    assert flight.texts[-2] == "SLZ: GPS lost, object on the point: take over"
    flight.having(intrusion=None, gps_lost=False).run(60)
    assert flight.executive.phase is Phase.HOLD


def test_below_commit_height_an_object_changes_nothing() -> None:
    flight = flown_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 1.3)
    flight.gps_lost = True
    flight.having(intrusion=Intrusion(1.6, np.array([20.0, 0.0, 1.6]), 0, 0)).fly_to(Phase.LANDED)


def test_the_operator_s_abort_without_gps_does_not_climb() -> None:
    flight = flown_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 9)
    flight.having(gps_lost=True).run(1)
    assert flight.executive.orders.abort(flight.situation()).accepted
    flight.run(0.2)
    assert stays(flight, 4)


def test_without_gps_no_order_to_land_is_taken() -> None:
    flight = flown_to(Phase.SURVEY)
    flight.having(gps_lost=True).run(1)
    for order in (flight.executive.orders.land_at_best, flight.executive.orders.land_now):
        reply = order(flight.situation())
        assert (reply.accepted, reply.reason) == (False, "GPS lost: fly by hand")


def test_an_odometry_that_guides_the_autopilot_makes_up_for_gps_until_it_loses_the_place() -> None:
    flight = flown_to(Phase.DESCEND, odometry="autopilot").having(place_by="odometry")
    flight.having(gps_lost=True, tracked=True).run(0.7)
    assert flight.texts[-1] == "SLZ: GPS lost: going on by the odometry"
    flight.having(tracked=False).run(0.7)
    assert flight.texts[-1] == AT_ONCE
    flight.fly_to(Phase.LANDED)


@pytest.mark.parametrize("phase", GUIDED_PHASES)
def test_who_called_the_pilot_begins_nothing_afterwards(phase: Phase) -> None:
    flight = flown_to(phase).run(0.5)
    if phase is Phase.DESCEND:
        return  # a descent that sinks unasked is broken off
    if phase is Phase.APPROACH:
        flight.state = lambda _height, _point: PointState.UNKNOWN
    flight.having(push=np.array([0.0, 0.0, -4.0])).run(3.5)
    assert "SLZ: sinking: take over" in flight.texts
    flight.having(push=np.zeros(3), state=lambda _height, _point: PointState.SAFE).run(90)
    assert flight.executive.phase is Phase.HOLD
    assert flight.mode == "GUIDED"


def test_a_landing_mode_that_is_accepted_after_the_call_for_its_refusal_is_not_asked_for() -> None:
    flight = flown_to(Phase.DESCEND)
    flight.having(obeys=False).fly_to(Phase.FINAL).run(2)
    flight.executive.on_refusal()
    flight.run(0.2)
    flight.having(obeys=True).run(60)
    assert flight.executive.phase is Phase.HOLD
    assert flight.mode == "GUIDED"
