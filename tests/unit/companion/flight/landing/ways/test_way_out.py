"""Climbs after an abort: up where nothing is above, else aside."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.landing.situation import Phase
from slz import SAFE, UNSAFE, Corridors
from tests.unit.companion.flight.landing.flight import Flight, PointState, zone
from tests.unit.companion.flight.landing.ways.corridors import made

ROOF_M, ROOF_HALF_M = 12.0, 4.0


def under_a_roof(f: Flight) -> bool:
    """Whether something is close above: a roof of 8 m, 12 m over the point."""
    return bool(np.abs(f.position[:2]).max() < ROOF_HALF_M and ROOF_M - 4 < f.position[2] < ROOF_M)


def aborted_at(height_m: float, corridors: Corridors | None) -> Flight:
    one = Flight([zone(1, 0, 0)], height=20.0).having(corridors=lambda _flight: made())
    one.until(lambda f: f.executive.phase in (Phase.DESCEND, Phase.FINAL) and f.position[2] < height_m)
    one.state = lambda _height, _point: PointState.UNSAFE
    one.corridors = lambda _flight: corridors
    return one.fly_to(Phase.CLIMB)


@pytest.mark.parametrize("height_m", [14.0, 9.0, 5.0, 2.5])
def test_with_nothing_above_it_climbs_straight_up(height_m: float) -> None:
    one = aborted_at(height_m, made())
    one.zones.clear()
    one.until(lambda f: f.executive.phase is Phase.SURVEY)
    assert np.abs(one.position[:2]).max() < 2


@pytest.mark.parametrize("height_m", [7.0, 5.0, 2.5])
def test_below_something_it_leaves_along_a_clear_way_and_climbs_beside_it(height_m: float) -> None:
    one = aborted_at(height_m, made({(270, 30.0): int(SAFE)}, all_of=int(UNSAFE)))
    one.zones.clear()
    one.blocked_above = under_a_roof

    def beside(f: Flight) -> bool:
        entered = ROOF_M - 0.5 < f.position[2] < ROOF_M and np.abs(f.position[:2]).max() < ROOF_HALF_M
        assert not entered, "climbed into what is above"
        return f.executive.phase is Phase.SURVEY

    one.until(beside)
    assert any("something above: leaving aside" in text for text in one.texts)
    assert one.position[0] < -ROOF_HALF_M


def test_without_a_way_aside_the_pilot_is_called() -> None:
    one = aborted_at(7.0, None)
    one.blocked_above = under_a_roof
    one.until(lambda f: any("no way aside: take over" in text for text in f.texts), 20)
    assert one.position[2] < ROOF_M
