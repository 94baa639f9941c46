"""Pace of a free-running simulation: real time, also for its clocks on a busy computer."""

from __future__ import annotations

from contextlib import closing
from functools import partial

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl import pace as pacing
from sitl import scenes
from sitl.pace import Pace
from sitl.simulation import TICK_NS, Simulation
from tests.unit.sitl.wire.test_wire import COMPANION, Station

MS, S = 1_000_000, 1_000_000_000


class Wall:
    """A computer's clock, on which a step takes as long as it is busy."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s, self.slept_s = 100.0, 0.0
        monkeypatch.setattr(pacing.time, "monotonic", lambda: self.now_s)
        monkeypatch.setattr(pacing.time, "sleep", self._sleep)

    def _sleep(self, seconds: float) -> None:
        self.slept_s += seconds
        self.now_s += seconds


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> Wall:
    return Wall(monkeypatch)


def test_pacing_sleeps_off_what_the_clock_is_ahead_and_does_not_race_after_a_long_stall(wall: Wall) -> None:
    pace = Pace(2.0)
    for k in range(4000):
        pace.keep(k * TICK_NS)
    assert wall.slept_s == pytest.approx(5.0, abs=0.01)  # ten simulated seconds at twice real time
    wall.now_s += 60.0
    for k in range(4000, 4400):
        pace.keep(k * TICK_NS)
    assert wall.slept_s == pytest.approx(5.5, abs=0.02)


def test_what_a_busy_computer_held_up_for_a_second_is_made_up_for(wall: Wall) -> None:
    pace, begun_s = Pace(1.0), wall.now_s
    for k in range(2000):
        pace.keep(k * TICK_NS)
        if k % 500 == 0:
            wall.now_s += 1.0  # held up
    assert wall.now_s - begun_s == pytest.approx(2000 * TICK_NS / S, abs=0.01)


def test_time_lost_all_the_same_is_said_once(wall: Wall) -> None:
    said: list[str] = []
    pace = Pace(1.0, said.append)
    for k in range(3):
        pace.keep(k * TICK_NS)
        wall.now_s += 5.0
    (text,) = said
    assert text.startswith("too slow for real time: the simulated clocks fall behind; ")


def test_scans_left_out_for_a_second_are_said_once() -> None:
    said: list[str] = []
    pace = Pace(1.0, said.append)
    for skipped_s in (0.0, 0.9, 1.1, 2.0):
        pace.note_skipped(round(skipped_s * S))
    (text,) = said
    assert text.startswith("too slow for real time: LiDAR scans are left out; ")


def test_a_late_simulation_flies_on_and_leaves_four_of_five_scans_out() -> None:
    with closing(Simulation(scenes.build("plain", 1), [], lidar_to=("127.0.0.1", 9))) as sim:
        late_s = [0.0]
        sim.late_s = lambda now_ns: late_s[0]
        sim.run(0.5)
        assert sim.skipped_ns == 0
        late_s[0] = 0.1
        sim.run(0.5)
        assert sim.skipped_ns == pytest.approx(0.4 * S, abs=20 * MS)
        late_s[0] = 0.0
        sim.run(0.5)
        assert sim.skipped_ns == pytest.approx(0.4 * S, abs=20 * MS)


def test_the_autopilot_s_clock_is_not_late_with_the_simulation() -> None:
    """TIMESYNC asks for the clock, which runs on while a busy computer holds up all the rest."""
    end = Station(1, COMPANION)
    with closing(Simulation(scenes.build("plain", 1), [end.wire])) as sim:
        sim.run(1.0)
        told = []
        for late_s in (0.0, 0.25):
            sim.late_s = partial(_always, late_s)
            end.heard()
            end.send(mavlink.MAVLink_timesync_message(0, 42))
            begun_ns = sim.autopilot.boot_ns
            sim.run(0.1)
            told += [m.tc1 - begun_ns for m in end.heard() if m.get_type() == "TIMESYNC" and m.ts1 == 42]
    assert told == [pytest.approx(0, abs=5 * MS), pytest.approx(250 * MS, abs=5 * MS)]


def _always(late_s: float, _now_ns: int) -> float:
    return late_s
