"""Flights of the rare-event search; all of it: `python -m tests.search`."""

from dataclasses import replace
from pathlib import Path

import pytest

from tests.search.flight import COARSE, FULL, fly
from tests.search.scenario import Scenario, read
from tests.search.weaknesses import WEAKNESSES

pytestmark = pytest.mark.long

WIND = {"wind_ms": 6.5, "wind_from_deg": 200.0}
COMES = {"hazard": "box", "hazard_height_m": 1.1, "hazard_below_m": 4.0, "hazard_speed_ms": 9.0}


def test_a_planted_weakness_lands_on_what_the_program_avoids() -> None:
    scenario = Scenario.of(**WIND, **COMES)
    avoided = fly(scenario)
    assert avoided.end == "aborted"
    assert avoided.margin > 0.05
    landed = fly(scenario, weakness=WEAKNESSES["crosswind"])
    assert landed.end == "unsafe"
    assert landed.parts["hazard"] <= 0.01


@pytest.mark.bench
@pytest.mark.parametrize("name", WEAKNESSES)
def test_the_least_that_a_weakness_needs_is_unsafe_by_it_alone(name: str) -> None:
    """Kept failures of `plant`, each at its edge: a changed program may be safe there."""
    scenario = read(Path(__file__).parents[1] / "search" / "found" / f"{name}.json")
    assert fly(scenario, COARSE, weakness=WEAKNESSES[name]).unsafe
    assert not fly(scenario, COARSE).unsafe


@pytest.mark.bench
def test_a_scenario_is_the_same_flight_each_time_and_ends_as_the_full_one() -> None:
    scenario = Scenario.of(**WIND)
    first, again, full = fly(scenario), fly(scenario), fly(scenario, FULL)
    assert replace(again, cpu_s=first.cpu_s) == first
    assert (first.end, full.end) == ("safe", "safe")
    assert abs(first.margin - full.margin) < 0.1


@pytest.mark.bench
def test_a_start_that_strikes_something_is_no_landing() -> None:
    outcome = fly(Scenario.of(seed=8, start_deg=144.0))
    assert (outcome.end, outcome.margin, outcome.touchdown) == ("refused", 1.0, None)
