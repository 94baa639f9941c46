"""Restart of the companion in flight: the remaining state, and the landing under way."""

from pathlib import Path

import numpy as np
import pytest

from companion.flight.landing.landing_memory import FILE, Landing, LandingMemory
from companion.flight.landing.restart import Restart
from companion.flight.landing.situation import Phase
from companion.runtime.state_directory import StateDir
from slz import PointState
from tests.unit.companion.flight.landing.flight import FRAME, Flight, zone

NOWHERE = (float("nan"),) * 3


def left_at(point_enu_m: list[float] | None, phase: str = "final", boot_ms: int = 60_000) -> Landing:
    lat, lon, alt = NOWHERE if point_enu_m is None else (float(v) for v in FRAME.lla(np.array(point_enu_m)))
    return Landing(phase, 1, boot_ms, lat, lon, alt)


def restarted(
    folder: Path,
    left: Landing | None,
    *,
    mode: str,
    height: float = 8.0,
    auto: bool = True,
    no_command_reason: str = "",
) -> Flight:
    """A flight of a new companion over (20, 0), three steps after it has heard the autopilot."""
    state = StateDir(folder)
    LandingMemory(state).keep(left)
    flight = Flight([zone(1, 20, 0)], auto=auto, height=height)
    flight.position[0], flight.mode = 20.2, mode
    flight.no_command_reason = no_command_reason
    restart = Restart(LandingMemory(state))
    for _ in range(3):
        flight.step()
        restart.update(flight.situation(), flight.executive, FRAME, 1, 64_000)
    flight.step()
    return flight


def test_a_landing_under_way_is_watched_again_at_once(tmp_path: Path) -> None:
    flight = restarted(tmp_path, left_at([20, 0, 0]), mode="LAND")
    assert flight.executive.phase is Phase.FINAL
    assert flight.texts == ["SLZ: restarted in LAND: watching the landing again"]
    target = flight.commands[-1][3].target_enu_m
    assert target is not None
    assert target[:2] == pytest.approx([20, 0], abs=0.02)
    flight.fly_to(Phase.LANDED)


def test_a_landing_on_the_wing_is_not_taken_up_again(tmp_path: Path) -> None:
    flight = restarted(tmp_path, left_at([20, 0, 0]), mode="LAND", no_command_reason="VTOL state unknown")
    flight.run(3)
    assert flight.executive.phase is Phase.IDLE
    assert not any("watching" in text for text in flight.texts)


def test_the_point_taken_up_again_is_broken_off_when_it_proves_unsafe(tmp_path: Path) -> None:
    flight = restarted(tmp_path, left_at([20, 0, 0]), mode="LAND")
    flight.having(state=lambda _height, _point: PointState.UNSAFE).run(0.5)
    assert flight.executive.tally.abort_reasons == ["point unsafe"]


def test_a_point_that_is_not_seen_again_in_time_is_broken_off(tmp_path: Path) -> None:
    flight = restarted(tmp_path, left_at([20, 0, 0]), mode="LAND", height=30.0)
    flight.having(state=lambda _height, _point: PointState.UNKNOWN).run(6)
    assert flight.executive.phase is Phase.FINAL
    flight.run(4)
    assert flight.executive.tally.abort_reasons == ["point unknown"]


@pytest.mark.parametrize(
    "left",
    [
        None,
        left_at([30, 0, 0]),  # elsewhere
        left_at(None),
        left_at([20, 0, 0], phase="descend"),  # this landing is another's
        left_at([20, 0, 0], boot_ms=70_000),  # of a flight before the autopilot was started
    ],
)
def test_another_landing_is_not_taken_for_ours_and_the_pilot_is_told(
    tmp_path: Path, left: Landing | None
) -> None:
    flight = restarted(tmp_path, left, mode="LAND")
    assert flight.executive.phase is Phase.IDLE
    assert len(flight.texts) == 1
    assert flight.texts[0].endswith("in LAND: landing not watched, take over")


def test_a_flight_under_way_in_another_mode_is_told(tmp_path: Path) -> None:
    flight = restarted(tmp_path, left_at([20, 0, 0], phase="descend"), mode="LOITER")
    assert flight.texts == ["SLZ: restarted, LOITER: hand over again"]


@pytest.mark.parametrize(
    ("auto", "told"), [(True, "restarted in flight: going on"), (False, "restarted, GUIDED: order again")]
)
def test_a_hand_over_that_still_stands_is_gone_on_with_only_in_auto(
    tmp_path: Path, auto: bool, told: str
) -> None:
    flight = restarted(tmp_path, left_at(None, phase="survey"), mode="GUIDED", height=30.0, auto=auto)
    assert flight.texts[0] == f"SLZ: {told}"


def test_nothing_is_said_on_the_ground_and_of_a_first_start(tmp_path: Path) -> None:
    assert restarted(tmp_path, left_at([20, 0, 0]), mode="GUIDED", height=0.0).texts == []
    assert restarted(tmp_path, None, mode="LOITER", height=30.0).texts == []


def test_without_a_position_the_pilot_is_told_after_three_seconds(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    LandingMemory(state).keep(left_at([20, 0, 0]))
    flight = Flight([], height=8.0).having(mode="LAND", blind=True)
    restart = Restart(LandingMemory(state))
    for _ in range(40):
        flight.step()
        restart.update(flight.situation(), flight.executive, None, 1, 64_000)
    assert flight.texts == ["SLZ: restarted in LAND: landing not watched, take over"]


def test_what_is_over_is_forgotten_and_what_is_damaged_is_nothing(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    memory = LandingMemory(state)
    memory.keep(left_at([20, 0, 0]))
    again = LandingMemory(state).previous
    assert again is not None
    assert again.lat_deg == pytest.approx(FRAME.lat_deg, abs=1e-3)
    memory.keep(None)
    assert LandingMemory(state).previous is None
    (tmp_path / FILE).write_text('{"phase": ')
    assert LandingMemory(state).previous is None


def test_the_record_follows_the_landing_under_way(tmp_path: Path) -> None:
    state = StateDir(tmp_path)
    flight, restart = Flight([zone(1, 20, 0)]), Restart(LandingMemory(state))

    def recorded() -> Landing | None:
        restart.update(flight.situation(), flight.executive, FRAME, 1, round(flight.time_s * 1e3) + 1)
        return LandingMemory(state).previous

    assert recorded() is None
    flight.fly_to(Phase.APPROACH)
    first = recorded()
    assert first is not None
    flight.run(0.2)
    assert recorded() == first  # of the moment when phase and point became so
    flight.fly_to(Phase.DESCEND)
    then = recorded()
    assert then is not None
    assert (then.phase, then.lat_deg) == ("descend", first.lat_deg)
    assert then.boot_ms > first.boot_ms
    flight.fly_to(Phase.LANDED)
    assert recorded() is None
