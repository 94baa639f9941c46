"""Aborts that the autopilot did not hear in time: they are judged anew, and below the commit height void."""

import pytest

from companion.flight.landing.situation import MissingInput, Phase
from slz import PointState
from tests.unit.companion.flight.landing.flight import Flight, zone

AGAIN = "SLZ: abort too late: watching the landing again"


def landing_out_of_reach(until_m: float, from_m: float = 9.0) -> Flight:
    """A landing whose link is out between two heights; back, it is heard before its poses are."""
    flight = Flight([zone(1, 10, 0), zone(2, -20, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < from_m)
    flight.having(blind=True, obeys=False, lidar_ok=False, lost=MissingInput.LINK_LOST).run(2.0)
    flight.heard = flight.connected = False
    flight.until(lambda f: f.position[2] < until_m)
    flight.heard = flight.connected = flight.obeys = True
    flight.run(0.2)
    flight.blind = False
    return flight


def test_an_abort_decided_before_a_long_outage_is_not_carried_out_when_the_link_is_back() -> None:
    flight = landing_out_of_reach(until_m=2.3, from_m=11.9)
    before = len(flight.commands)
    flight.run(0.2)
    assert flight.executive.phase is Phase.FINAL
    flight.fly_to(Phase.LANDED)
    assert not any(commands.mode for *_, commands in flight.commands[before:])
    assert flight.texts.count(AGAIN) == 1
    assert not any("back: hovering" in text for text in flight.texts)


def test_the_point_is_judged_anew_when_it_is_seen_again() -> None:
    flight = landing_out_of_reach(until_m=6.0)
    flight.run(1)
    assert flight.executive.phase is Phase.FINAL
    flight.having(lidar_ok=True, state=lambda _height, _point: PointState.UNSAFE).run(0.5)
    assert flight.mode == "GUIDED"
    assert flight.executive.tally.abort_reasons == ["position lost", "point unsafe"]


@pytest.mark.parametrize("height_m", [6.0, 1.3])
def test_the_operator_s_abort_holds_through_an_outage_down_to_the_commit_height(height_m: float) -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 9)
    flight.obeys = False
    assert flight.executive.orders.abort(flight.situation()).accepted
    flight.run(0.5)
    flight.having(heard=False).until(lambda f: f.position[2] < height_m)
    assert AGAIN not in flight.texts
    flight.heard = flight.obeys = True
    flight.run(0.5)
    assert (flight.mode == "GUIDED") == (height_m > 2)


def test_an_abort_that_the_autopilot_refuses_ends_at_the_commit_height() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 6)
    flight.obeys, flight.state = False, lambda _height, _point: PointState.UNSAFE
    flight.until(lambda f: f.position[2] < 2)
    assert flight.commands[-1][3].mode == "guided"
    flight.until(lambda f: f.position[2] < 1.4)
    flight.having(obeys=True).fly_to(Phase.LANDED)
    assert flight.mode == "LAND"


@pytest.mark.parametrize("delay_s", [0.1, 0.5, 0.9])
def test_an_abort_just_above_the_commit_height_is_carried_out_though_it_is_obeyed_below(
    delay_s: float,
) -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 1.6)
    flight.obeys, flight.state = False, lambda _height, _point: PointState.UNSAFE
    flight.fly_to(Phase.CLIMB).run(delay_s)
    assert flight.position[2] < 1.5
    flight.having(mode="GUIDED").run(5)
    assert flight.position[2] > 5
    assert flight.texts[-1] == "SLZ: abort: point unsafe"
