"""Words for what the vehicle does now and next, over whole flights."""

from __future__ import annotations

import re

import pytest

from companion.flight.landing.situation import Phase
from tests.unit.companion.flight.landing.flight import Flight, zone


def told(flight: Flight) -> tuple[str, str]:
    words = flight.executive.outlook(flight.situation())
    return words.doing, words.abort


def test_each_phase_of_a_landing_tells_what_comes_next_and_what_an_abort_does() -> None:
    flight = Flight([zone(1, 20, 0)])
    said: dict[Phase, list[tuple[str, str]]] = {}
    while flight.executive.phase is not Phase.LANDED and flight.time_s < 200:
        flight.step()
        said.setdefault(flight.executive.phase, []).append(told(flight))
    assert said[Phase.SURVEY][0] == ("surveying, then flies to a zone", "holds here")
    assert re.fullmatch(r"\d+ m to the point, then descends", said[Phase.APPROACH][0][0])
    doing, abort = said[Phase.DESCEND][-1]
    assert re.fullmatch(r"LAND in \d+ s, touchdown in \d+ s; abort till 1\.5 m", doing)
    assert re.fullmatch(r"climbs \d+ m, then holds", abort)
    assert said[Phase.FINAL][0][0].startswith("landing: touchdown in ")
    assert said[Phase.FINAL][-1] == ("landing: too low to abort", "")
    assert said[Phase.LANDED] == [("", "")]


def test_after_an_abort_low_down_it_climbs_and_then_holds() -> None:
    flight = Flight([zone(1, 20, 0)])
    while flight.executive.phase is not Phase.FINAL:
        flight.step()
    flight.executive.orders.abort(flight.situation())
    words = told(flight)
    assert flight.executive.phase is Phase.HOLD
    assert flight.executive.outlook(flight.situation()).phase is Phase.CLIMB
    assert re.fullmatch(r"climbing \d+ m, then holds for an order", words[0])
    for _ in range(300):
        flight.step()
    assert told(flight) == ("holds for an order", "holds here")
    assert flight.executive.outlook(flight.situation()).phase is Phase.HOLD


@pytest.mark.parametrize(
    ("phase", "name", "lost", "doing"),
    [
        (Phase.SURVEY, "gps_lost", True, "hovers: GPS lost, fly by hand"),
        (Phase.APPROACH, "lidar_ok", False, "hovers"),
    ],
)
def test_a_vehicle_that_waits_for_what_is_lost_is_not_said_to_go_on(
    phase: Phase, name: str, lost: bool, doing: str
) -> None:
    flight = Flight([zone(1, 20, 0)])
    while flight.executive.phase is not phase:
        flight.step()
    setattr(flight, name, lost)
    flight.run(1)
    assert flight.executive.phase is phase
    assert told(flight) == (doing, "holds here")


def test_nothing_is_told_on_the_ground_and_the_autopilot_s_own_mode_when_it_flies() -> None:
    flight = Flight([], auto=False)
    assert told(flight) == ("", "")
    flight = Flight([zone(1, 20, 0)])
    for _ in range(100):
        flight.step()
    flight.having(failsafe=True, mode="RTL").step()
    assert flight.executive.phase is Phase.FAILSAFE
    assert told(flight) == ("RTL flies by itself, no commands", "")
