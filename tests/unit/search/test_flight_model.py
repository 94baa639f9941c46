"""Model of a flight, by which forms of the search are compared."""

from __future__ import annotations

import pytest

from tests.search.counts import numbered
from tests.search.flight import ABORTED, SAFE, UNSAFE, Outcome
from tests.search.flight_model import FlightModel
from tests.search.scenario import Scenario

BOX: dict[str, float | str] = {
    "hazard": "box",
    "hazard_below_m": 4.0,
    "hazard_speed_ms": 8.0,
    "hazard_height_m": 1.1,
}
HEARTS: dict[str, dict[str, float | str]] = {
    "crosswind": BOX | {"wind_ms": 6.0, "wind_from_deg": 200.0},
    "between_heights": BOX | {"hazard_height_m": 0.7, "hazard_from_deg": 90.0},
    "stale_evidence": BOX
    | {"fault": "lidar_stop", "fault_below_m": 4.7, "fault_s": 9.0, "wind_ms": 4.0, "wind_from_deg": 90.0},
    "late_computer": BOX | {"late_s": 0.6, "wind_ms": 5.0, "wind_from_deg": 315.0},
    "clock_offset": BOX
    | {"link_delay_s": 0.12, "wind_ms": 5.0, "wind_from_deg": 180.0, "hazard_aside_m": 4.0}
    | {"hazard_aside_deg": 90.0},
}


def flown(weakness: str | None, seed: int, **values: float | str) -> Outcome:
    return FlightModel(Scenario.of(seed=seed, **values), weakness).outcome()


@pytest.mark.parametrize(("weakness", "heart"), HEARTS.items())
def test_a_weakness_is_unsafe_where_its_conditions_meet_and_nothing_is_without_it(
    weakness: str, heart: dict[str, float | str]
) -> None:
    ends = [flown(weakness, seed, **heart).end for seed in range(20)]
    assert ends.count(UNSAFE) > 10
    assert not any(flown(None, seed, **heart).unsafe for seed in range(20))


@pytest.mark.parametrize(("weakness", "heart"), HEARTS.items())
def test_far_from_there_a_weakness_changes_nothing(weakness: str, heart: dict[str, float | str]) -> None:
    far = heart | {"wind_ms": 0.0, "hazard_from_deg": 270.0}
    for seed in range(20):
        assert flown(weakness, seed, **far) == flown(None, seed, **far)


def test_the_same_scenario_is_the_same_flight() -> None:
    for number in range(20):
        first, again = (FlightModel(numbered(1, number), None).outcome() for _ in range(2))
        assert first == again


def test_what_comes_late_is_answered_late_and_lower() -> None:
    quick = flown(None, 3, **BOX)
    late = flown(None, 3, **BOX | {"late_s": 0.8})
    assert (quick.end, late.end) == (ABORTED, ABORTED)
    assert late.response["reaction"] < quick.response["reaction"]
    assert late.margin < quick.margin


def test_with_nothing_in_the_way_it_lands_at_the_point() -> None:
    landed = flown(None, 1)
    assert landed.end == SAFE
    assert landed.response["accuracy"] > 0.8
