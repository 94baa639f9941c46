"""Orders of the operator: accepted or refused, emergencies, selections and confirmations."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.landing.situation import Phase
from slz import PointState
from tests.unit.companion.flight.landing.flight import Flight, replace, zone

AHEAD = np.array([0.0, 9.0, 0.0])


@pytest.mark.parametrize(
    ("order", "given", "lands_at"),
    [("land_at_best", (), (5, 0)), ("land_in_zone", (7,), (-15, 3)), ("land_at_point", (AHEAD,), (0, 9))],
)
def test_an_order_is_carried_out(order: str, given: tuple, lands_at: tuple[float, float]) -> None:
    flight = Flight([zone(1, 5, 0, clearance=9), zone(7, -15, 3)], auto=False).run(1)
    assert flight.executive.orders.land_in_zone(flight.situation(), 3).reason == "no zone 3"
    assert getattr(flight.executive.orders, order)(flight.situation(), *given).accepted
    flight.fly_to(Phase.LANDED)
    assert np.hypot(*(flight.position[:2] - lands_at)) < 0.5


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("mode", "LOITER", "set GUIDED first"),
        ("armed", False, "not flying"),
        ("connected", False, "no autopilot"),
    ],
)
def test_orders_are_refused_with_the_reason(name: str, value: object, reason: str) -> None:
    flight = Flight([zone(1, 0, 0)], auto=False).run(1)
    assert flight.executive.orders.abort(flight.situation()).reason == "nothing to abort"
    setattr(flight, name, value)
    reply = flight.executive.orders.land_at_best(flight.situation())
    assert (reply.accepted, reply.reason) == (False, reason)
    emergency = flight.executive.orders.land_now(flight.situation())
    assert (emergency.accepted, emergency.reason) == (
        (True, "landing") if name == "mode" else (False, reason)
    )


def test_unsafe_point_of_the_operator_is_refused_in_the_air() -> None:
    flight = Flight([], auto=False).run(1).having(state=lambda _h, _p: PointState.UNSAFE)
    assert flight.executive.orders.land_at_point(flight.situation(), np.array([5.0, 5.0, 0.0])).accepted
    flight.run(60)
    assert Phase.DESCEND not in flight.phases


def test_abort_holds_until_a_new_order() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    assert flight.executive.orders.abort(flight.situation()).accepted
    flight.run(60)
    assert flight.executive.phase is Phase.HOLD
    assert flight.position[2] > 25
    assert flight.executive.orders.land_at_best(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)


def test_abort_below_commit_height_is_refused_and_the_landing_goes_on() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 1.0)
    reply = flight.executive.orders.abort(flight.situation())
    assert not reply.accepted
    assert "below commit height" in reply.reason
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


@pytest.mark.parametrize("phase", [Phase.DESCEND, Phase.FINAL])
def test_an_emergency_in_a_landing_lets_it_go_on_and_another_order_is_refused(phase: Phase) -> None:
    flight = Flight([zone(1, 10, 0), zone(2, 12, 0)]).fly_to(phase)
    reply = flight.executive.orders.land_in_zone(flight.situation(), 2)
    assert (reply.accepted, reply.reason) == (False, "descending: abort first")
    assert flight.executive.orders.land_now(flight.situation()).reason == "landing already"
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(10, abs=0.5)
    assert flight.executive.tally.aborts == 0


def test_each_order_and_each_end_of_one_is_a_turn_and_its_progress_is_none() -> None:
    flight = Flight([zone(1, 10, 0), zone(2, -20, 0)], auto=False).run(1)
    executive, turns = flight.executive, [0]

    def turned() -> bool:
        turns.append(executive.order_count)
        return turns[-1] > turns[-2]

    executive.orders.select_zone(flight.situation(), 2)
    assert turned()
    executive.orders.land_at_best(flight.situation())
    assert turned()
    flight.fly_to(Phase.DESCEND)
    assert not turned()
    executive.orders.abort(flight.situation())
    assert turned()
    executive.orders.land_at_best(flight.situation())
    assert turned()
    flight.run(1).mode = "LOITER"
    flight.run(1)
    assert turned()


def test_there_is_no_zone_to_land_in_before_the_first_report() -> None:
    flight = Flight([zone(1, 10, 0)], auto=False).run(1)
    unmapped = replace(flight.situation(), report=None)
    assert flight.executive.orders.land_in_zone(unmapped, 1).reason == "no zone 1"
    assert not flight.executive.orders.select_zone(unmapped, 1).accepted


@pytest.mark.parametrize("mode", ["LOITER", "GUIDED", "RTL"])
def test_an_emergency_lands_at_the_nearest_zone_from_any_mode(mode: str) -> None:
    flight = Flight([zone(1, 60, 0, clearance=9), zone(2, -10, 0)], auto=False)
    flight.having(mode=mode).run(1)
    assert flight.executive.orders.land_now(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(-10, abs=0.5)
    assert flight.executive.tally.hands_off == 0


def test_an_emergency_goes_towards_a_far_zone_where_there_is_no_near_one() -> None:
    flight = Flight([], auto=False)
    flight.having(far_zones=[zone(3, 50, 0), zone(4, -20, 0)]).run(1)
    flight.executive.orders.land_now(flight.situation())
    flight.fly_to(Phase.APPROACH)
    assert flight.executive.tally.zone_id == 4


def in_an_emergency_that_is_not_obeyed(blind: bool = False) -> Flight:
    flight = Flight([zone(1, 60, 0)], auto=False).having(mode="LOITER", obeys=False)
    flight.run(1).blind = blind
    assert flight.executive.orders.land_now(flight.situation()).accepted
    return flight


def test_an_emergency_ends_when_the_pilot_chooses_another_mode_or_it_is_aborted() -> None:
    flight = in_an_emergency_that_is_not_obeyed().run(1)
    assert flight.having(mode="ALT_HOLD").silent_for(10)
    flight = in_an_emergency_that_is_not_obeyed().run(0.5)
    assert flight.executive.orders.abort(flight.situation()).accepted
    assert flight.silent_for(20)


@pytest.mark.parametrize("blind", [False, True])
def test_an_emergency_is_given_up_when_the_autopilot_refuses_the_mode(blind: bool) -> None:
    flight = in_an_emergency_that_is_not_obeyed(blind).run(20)
    assert flight.executive.phase is Phase.IDLE
    assert flight.is_silent_since(-1)
    assert "SLZ: LOITER stays: not landing" in flight.texts


def test_an_order_without_a_position_begins_where_the_vehicle_is_then() -> None:
    flight = Flight([], auto=False, height=60.0).run(1)
    flight.executive.orders.land_at_best(flight.situation())
    flight.run(1)
    flight.having(mode="LOITER").run(1)
    flight.mode, flight.position, flight.blind = "GUIDED", np.array([500.0, 0.0, 20.0]), True
    flight.executive.orders.land_at_best(flight.situation())
    flight.run(1)
    flight.having(blind=False).run(5)
    assert flight.position[2] == pytest.approx(20, abs=0.5)


def test_a_zone_is_selected_and_then_confirmed_and_never_the_selection_before() -> None:
    flight = Flight([zone(1, 20, 0, clearance=9), zone(2, -10, 0)], auto=False).run(1)
    assert flight.executive.orders.land_at_selected(flight.situation()).reason == "nothing selected"
    assert not flight.executive.orders.select_zone(flight.situation(), 9).accepted
    assert flight.executive.orders.select_zone(flight.situation(), 1).accepted
    assert flight.silent_for(5)
    assert flight.executive.orders.select_zone(flight.situation(), 2).accepted
    reply = flight.executive.orders.land_at_selected(flight.situation())
    assert (reply.accepted, reply.reason) == (False, "selection not judged yet: confirm again")
    assert flight.silent_for(2)
    assert flight.executive.orders.land_at_selected(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(-10, abs=0.5)


def test_after_an_abort_another_zone_is_selected_and_confirmed() -> None:
    flight = Flight([zone(1, 20, 0, clearance=9), zone(2, -10, 0)]).fly_to(Phase.DESCEND)
    assert not flight.executive.orders.select_zone(flight.situation(), 2).accepted
    flight.executive.orders.abort(flight.situation())
    flight.run(3)
    assert flight.executive.orders.select_zone(flight.situation(), 2).accepted
    flight.run(3)
    assert flight.executive.phase is Phase.HOLD
    assert flight.executive.orders.land_at_selected(flight.situation()).accepted
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] == pytest.approx(-10, abs=0.5)


def test_an_order_after_an_abort_does_not_end_the_climb() -> None:
    flight = Flight([zone(1, 10, 0), zone(2, -60, 0)], survey_height_m=3.0).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 5)
    flight.executive.orders.abort(flight.situation())
    flight.run(0.5)
    assert flight.executive.orders.land_in_zone(flight.situation(), 2).accepted
    flight.until(lambda f: f.position[0] < -55)
    assert flight.position[2] == pytest.approx(30, abs=1)


def test_a_far_zone_is_looked_at_when_the_survey_found_no_near_one() -> None:
    flight = Flight([])
    flight.having(far_zones=[zone(8, 70, 0)]).fly_to(Phase.APPROACH)
    assert flight.executive.tally.zone_id == 8
