"""Scans, maps or positions that are late: hold, call, and report when they are back."""

from __future__ import annotations

import numpy as np
import pytest

from companion.flight.landing.situation import MissingInput, Phase
from slz import PointState
from tests.unit.companion.flight.landing.flight import Flight, flown_to, zone


def test_a_position_lost_in_final_breaks_off_and_holds() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 8)
    flight.having(blind=True).run(1)
    assert flight.mode == "GUIDED"
    assert np.allclose(flight.velocity, 0)
    assert flight.executive.tally.abort_reasons == ["position lost"]
    flight.run(15)
    assert flight.executive.phase is Phase.HOLD
    assert any("position still lost: take over" in text for text in flight.texts)


def test_a_position_lost_below_commit_height_lets_the_autopilot_land() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 1.2)
    flight.having(blind=True).fly_to(Phase.LANDED)
    assert flight.executive.tally.aborts == 0


@pytest.mark.parametrize("lost", [MissingInput.LIDAR_LOST, MissingInput.POSITION_LOST])
def test_what_the_pilot_was_called_for_is_told_when_it_is_back_and_nothing_begins(lost: MissingInput) -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.APPROACH).having(lost=lost)
    flight.having(lidar_ok=False, blind=lost is MissingInput.POSITION_LOST).fly_to(Phase.HOLD).run(40)
    flight.having(lidar_ok=True, blind=False).run(60)
    assert flight.executive.phase is Phase.HOLD
    assert flight.texts.count(f"SLZ: {lost.thing} back: hovering, order again") == 1


@pytest.mark.parametrize(
    "gaps",
    [
        [(MissingInput.SCANS_LATE, 3.0, 0.0), (MissingInput.MAP_LATE, 3.0, 0.0)] * 3,
        [(MissingInput.LIDAR_LOST, 6.0, 0.2)] * 3,
    ],
    ids=["what is missing changes", "it comes back for an instant"],
)
def test_an_outage_lasts_until_everything_is_back_for_a_second(
    gaps: list[tuple[MissingInput, float, float]],
) -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.APPROACH)
    for what, seconds, back_s in gaps:
        flight.having(lidar_ok=False, lost=what).run(seconds)
        flight.having(lidar_ok=True).run(back_s)
    assert sum("take over" in text for text in flight.texts) == 1
    assert "holding" not in "".join(flight.texts[flight.texts.index(_call(flight)) :])
    assert flight.executive.phase is Phase.HOLD


def test_a_map_late_after_a_lost_link_has_its_own_time_to_come() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.APPROACH).having(lidar_ok=False)
    link, late = MissingInput.LINK_LOST, MissingInput.MAP_LATE
    for flight.lost, seconds in ((link, 8.0), (late, 6.0), (link, 1.0), (late, 2.0)):
        flight.run(seconds)
    assert not any("take over" in text for text in flight.texts)
    flight.run(2)
    assert "SLZ: map still late: take over" in flight.texts


def _call(flight: Flight) -> str:
    return next(text for text in flight.texts if "take over" in text)


@pytest.mark.parametrize("lost", [MissingInput.LIDAR_LOST, MissingInput.POSITION_LOST])
def test_what_is_lost_while_it_hovers_is_told_too(lost: MissingInput) -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.APPROACH)
    flight.executive.orders.abort(flight.situation())
    flight.run(5)
    flight.having(lost=lost, lidar_ok=False, blind=lost is MissingInput.POSITION_LOST).run(11)
    assert flight.texts[-2:] == [f"SLZ: {lost.text}: holding", f"SLZ: {lost.thing} still lost: take over"]
    assert flight.executive.phase is Phase.HOLD


def test_a_position_found_again_is_used_again() -> None:
    flight = Flight([zone(1, 10, 0)]).fly_to(Phase.DESCEND)
    flight.having(blind=True).run(4)
    flight.blind = False
    flight.zones.append(zone(2, -20, 0))
    flight.fly_to(Phase.LANDED)
    assert flight.position[0] < -19


def test_a_position_lost_twice_for_a_moment_is_not_lost_for_long() -> None:
    flight = Flight([zone(1, 10, 0), zone(2, -20, 0)], climb_speed_ms=1.0).fly_to(Phase.FINAL)
    flight.until(lambda f: f.position[2] < 5)
    for seconds in (11, 1):
        flight.having(blind=True).run(0.2)
        flight.having(blind=False).run(seconds)
    assert flight.executive.phase is Phase.CLIMB
    assert not any("take over" in text for text in flight.texts)
    flight.fly_to(Phase.LANDED)


def test_after_a_lost_lidar_the_point_must_be_safe_for_two_seconds_again() -> None:
    flight = Flight([zone(1, 10, 0)])
    flight.having(state=lambda _h, _point: PointState.UNKNOWN).fly_to(Phase.APPROACH).run(12)
    flight.having(state=lambda _h, _point: PointState.SAFE).run(1)
    flight.having(lidar_ok=False).run(5)
    flight.having(lidar_ok=True).run(1)
    assert flight.executive.phase is Phase.APPROACH
    flight.run(2)
    assert flight.executive.phase is Phase.DESCEND


@pytest.mark.parametrize("blind", list(MissingInput))
def test_what_is_lost_is_called_by_its_name(blind: MissingInput) -> None:
    flight = flown_to(Phase.APPROACH)
    flight.having(lidar_ok=False, lost=blind).run(12)
    assert f"SLZ: {blind.text}: holding" in flight.texts
    assert f"SLZ: {blind.thing} still {blind.state}: take over" in flight.texts
