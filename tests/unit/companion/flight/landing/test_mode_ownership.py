"""Modes that show late, and the party that set them."""

from __future__ import annotations

import pytest

from companion.flight.landing.situation import Phase
from slz import PointState
from tests.unit.companion.flight.landing.flight import Flight, flown_to, zone


def test_a_landing_mode_that_shows_after_the_abort_is_ours_and_left_again() -> None:
    """LAND was ordered, the abort came before the autopilot had changed over."""
    flight = Flight([zone(1, 10, 0), zone(2, -20, 0)], final_height_m=25.0)
    flight.fly_to(Phase.DESCEND)
    flight.having(obeys=False).fly_to(Phase.FINAL)
    flight.having(state=lambda _h, point: PointState.UNSAFE if point[0] > 0 else PointState.SAFE).step()
    assert flight.executive.phase is Phase.CLIMB
    flight.run(0.5)
    flight.having(mode="LAND", obeys=True).fly_to(Phase.LANDED)
    assert flight.executive.tally.hands_off == 0
    assert flight.position[0] < -19


@pytest.mark.parametrize("phase", [Phase.SURVEY, Phase.APPROACH, Phase.DESCEND])
def test_a_landing_mode_that_shows_when_it_already_looks_elsewhere_is_left_again(phase: Phase) -> None:
    """The request for LAND was under way while the position was lost; nobody chose the ground below."""
    flight = Flight([zone(1, 10, 0), zone(2, 10, 7)], final_height_m=29.5, approach_speed_ms=20.0)
    flight.fly_to(Phase.DESCEND)
    flight.having(obeys=False).fly_to(Phase.FINAL)
    flight.having(blind=True).step()
    flight.blind = False
    flight.executive.progress.phase = phase
    flight.run(0.5)
    assert flight.executive.phase is phase
    flight.having(mode="LAND", obeys=True).run(1.0)
    assert flight.executive.phase is Phase.CLIMB
    assert flight.mode == "GUIDED"
    assert "SLZ: LAND came late: climbing" in flight.texts
    flight.fly_to(Phase.LANDED)
    assert flight.executive.tally.hands_off == 0


def test_a_guided_mode_that_was_asked_for_and_shows_after_a_silence_is_ours() -> None:
    """It obeyed while its heartbeats were lost: nobody else has it, so the climb goes on."""
    flight = Flight([zone(1, 10, 0), zone(2, -20, 0)]).fly_to(Phase.FINAL).run(1.0)
    flight.having(blind=True, obeys=False).run(2.0)
    assert flight.commands[-1][3].mode == "guided"
    flight.having(heard=False).run(1.0)
    flight.having(blind=False, heard=True, obeys=True, mode="GUIDED").fly_to(Phase.LANDED)
    assert flight.executive.tally.hands_off == 0
    assert flight.executive.tally.abort_reasons == ["position lost"]


def test_a_landing_mode_entered_while_nothing_was_heard_is_ours_and_broken_off() -> None:
    flight = Flight([zone(1, 10, 0), zone(2, -20, 0)], final_height_m=25.0)
    flight.fly_to(Phase.DESCEND)
    flight.having(obeys=False).fly_to(Phase.FINAL).run(0.3)
    flight.having(blind=True, heard=False).run(4.5)
    flight.having(blind=False, heard=True, obeys=True, mode="LAND").run(1.0)
    assert flight.mode == "GUIDED"
    assert flight.executive.phase is Phase.CLIMB
    assert flight.executive.tally.hands_off == 0


def test_a_landing_mode_that_the_pilot_chooses_later_is_the_pilot_s() -> None:
    flight = Flight([zone(1, 10, 0), zone(2, -20, 0)], final_height_m=25.0).fly_to(Phase.FINAL)
    flight.until(lambda f: f.mode == "LAND")
    flight.state = lambda _h, point: PointState.UNSAFE if point[0] > 0 else PointState.SAFE
    flight.fly_to(Phase.APPROACH)
    flight.run(4)
    assert flight.having(mode="LAND", obeys=False).silent_for(5)


@pytest.mark.parametrize("height", [8.0, 1.0])
def test_the_guided_mode_that_the_pilot_chooses_in_the_landing_is_the_pilot_s(height: float) -> None:
    flight = Flight([zone(1, 10, 0)], auto=False).run(1)
    flight.executive.orders.land_at_best(flight.situation())
    flight.fly_to(Phase.FINAL).until(lambda f: f.mode == "LAND" and f.position[2] < height)
    assert flight.having(mode="GUIDED").silent_for(10)
    assert flight.executive.tally.hands_off == 1


def test_a_landing_mode_right_after_the_abort_of_a_landing_is_the_pilot_s() -> None:
    flight = Flight([zone(1, 10, 0)], final_height_m=25.0).fly_to(Phase.FINAL).run(0.3)
    flight.executive.orders.abort(flight.situation())
    flight.run(1)
    assert flight.mode == "GUIDED"
    assert flight.having(mode="LAND").silent_for(5)


def test_a_landing_mode_that_is_refused_leaves_the_vehicle_where_it_is() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.DESCEND)
    flight.having(obeys=False).fly_to(Phase.FINAL).run(30)
    assert flight.executive.phase is Phase.FINAL
    assert flight.position[2] > 10


@pytest.mark.parametrize("connected", [True, False])
def test_who_hears_nothing_asks_for_no_mode(connected: bool) -> None:
    """The way out may still be open: what the pilot chose meanwhile would be undone, again and again."""
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 8)
    flight.heard, flight.connected, flight.blind, flight.obeys = False, connected, True, False
    before = len(flight.commands)
    flight.run(20)
    assert not any(commands.mode for *_, commands in flight.commands[before:])


@pytest.mark.parametrize(
    ("switched", "text"),
    [(True, "SLZ: pilot set LOITER: hands off"), (False, "SLZ: LOITER set, not by SLZ: hands off")],
)
def test_the_pilot_is_named_only_where_his_switch_was_seen(switched: bool, text: str) -> None:
    flight = flown_to(Phase.APPROACH)
    flight.having(mode="LOITER", switched=switched).run(1)
    assert flight.texts[-1] == text
