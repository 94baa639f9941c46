"""Georeferencing with an autopilot whose clock loses time, or whose messages are late.

A vehicle flies north at 10 m/s past one stone, the only object that its LiDAR sees. Wherever stamps of
poses and returns do not match, the stone is elsewhere on the map.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.link.command_server import CommandServer
from companion.flight.link.inbox import Inbox
from companion.flight.link.wire.codec import Codec
from companion.flight.sensors.returns import Returns
from params import Parameters
from slz import Scan
from tests.unit.companion.flight.link.messages import attitude, heartbeat, received

MS, S = 1_000_000, 1_000_000_000
STEP_NS, POSE_NS = 10 * MS, 20 * MS
BOOT_NS = 5 * S
SPEED_MS, STONE_M = 10.0, 100.0
LAST_NS = round(12.9 * S)
METRES = 111_319.49  # of a degree of latitude, near enough
LAT_DEG = 47.0
Clock = Callable[[int], int]


class Flight:
    """A flight of some seconds.

    Parameters
    ----------
    lost_ns
        Tells how much time the autopilot's clock has lost by a moment.
    late_ns
        Tells how long what is sent at a moment is under way, either way.
    answers_until_ns
        When the autopilot ceases to answer TIMESYNC.
    """

    def __init__(
        self, lost_ns: Clock = lambda _: 0, late_ns: Clock = lambda _: MS, answers_until_ns: int = 1000 * S
    ) -> None:
        parameters = Parameters(lidar_x_m=0.0, lidar_pitch_deg=0.0)
        self.inbox = Inbox(Codec(191), CommandServer())
        self.history = PoseHistory(parameters)
        self.scans: list[Scan] = []
        self.assembler = ScanAssembler(parameters, self.history, self.scans.append)
        self.inbox.on_certain.subscribe(self.history.limit_to_certain)
        self.inbox.on_attitude.subscribe(self.history.add_attitude)
        self.inbox.on_position.subscribe(self.history.add_position)
        self.inbox.on_reboot.subscribe(self.history.clear)
        self._lost_ns, self._late_ns = lost_ns, late_ns
        self._answers_until_ns = answers_until_ns
        self._wire: list[tuple[int, Callable[[int], object]]] = []

    def boot_ns(self, at_ns: int) -> int:
        return at_ns + BOOT_NS - self._lost_ns(at_ns)

    def is_held_up(self, at_ns: int) -> bool:
        """Tell whether its clock stands still: then it neither sends nor answers."""
        return self._lost_ns(at_ns + STEP_NS) - self._lost_ns(at_ns) == STEP_NS

    def fly(self, seconds: float) -> Flight:
        self.inbox.on_message(heartbeat(), 0)
        for at_ns in range(0, round(seconds * S), STEP_NS):
            due = [act for due_ns, act in self._wire if due_ns <= at_ns]
            self._wire = [entry for entry in self._wire if entry[0] > at_ns]
            for act in due:
                act(at_ns)
            if at_ns % POSE_NS == 0 and not self.is_held_up(at_ns):
                self._send_pose(at_ns)
            if at_ns % (50 * MS) == 0:
                self._ask_for_the_time(at_ns)
            self._see_the_stone(at_ns)
        return self

    def _send_pose(self, at_ns: int) -> None:
        boot_ms = self.boot_ns(at_ns) // MS
        lat_e7 = round((LAT_DEG + SPEED_MS * at_ns * 1e-9 / METRES) * 1e7)
        place = received(
            mavlink.MAVLink_global_position_int_message(
                boot_ms, lat_e7, 80_000_000, 412_000, 0, round(SPEED_MS * 100), 0, 0, 0
            )
        )
        for message in (attitude(boot_ms), place):
            self._later(at_ns, lambda now_ns, message=message: self.inbox.on_message(message, now_ns))

    def _ask_for_the_time(self, at_ns: int) -> None:
        sync = self.inbox.clock.timesync
        stamp = sync.request(at_ns)
        if stamp is None or at_ns > self._answers_until_ns:
            return

        def answer(now_ns: int) -> None:
            if self.is_held_up(now_ns):
                self._wire.append((now_ns + STEP_NS, answer))
                return
            told_ns = self.boot_ns(now_ns)
            self._later(now_ns, lambda back_ns: sync.reply(told_ns, stamp, back_ns))

        self._later(at_ns, answer)

    def _later(self, at_ns: int, act: Callable[[int], object]) -> None:
        self._wire.append((at_ns + self._late_ns(at_ns), act))

    def _see_the_stone(self, at_ns: int) -> None:
        stamps = at_ns - STEP_NS + np.arange(10) * (STEP_NS // 10)
        ahead = STONE_M - SPEED_MS * stamps * 1e-9
        near = np.abs(ahead) < 30.0
        xyz = np.column_stack([ahead, np.full(10, 5.0), np.zeros(10)])[near]
        if near.any():
            self.assembler.add(Returns.plain(xyz.astype(np.float32), stamps[near]))

    def errors_m(self) -> np.ndarray:
        """Return how far to the north of the stone its returns were placed."""
        return np.concatenate([scan.points_enu_m[:, 1] for scan in self.scans]) - STONE_M

    def silences_s(self) -> np.ndarray:
        """Return the times between returns that were placed, to the last that could be (of 13 s)."""
        placed = np.sort(np.concatenate([scan.stamp_ns for scan in self.scans]))
        return np.diff(placed, append=max(placed[-1], LAST_NS)) * 1e-9


def test_with_a_steady_clock_the_stone_is_where_it_is() -> None:
    flight = Flight().fly(13.0)
    assert np.abs(flight.errors_m()).max() < 0.2
    assert flight.silences_s().max() < 0.02


@pytest.mark.parametrize("lost_ms", [60, 150, 300])
def test_no_return_is_placed_by_poses_of_a_clock_that_has_lost_time(lost_ms: int) -> None:
    flight = Flight(lost_ns=lambda at_ns: lost_ms * MS if at_ns >= 9 * S else 0).fly(13.0)
    assert np.abs(flight.errors_m()).max() < 0.3
    assert flight.silences_s().max() < 1.0
    assert flight.history.epoch == 0


def test_a_clock_that_loses_time_and_answers_no_more_is_followed_by_its_poses() -> None:
    flight = Flight(
        lost_ns=lambda at_ns: 300 * MS if at_ns >= 9 * S else 0,
        late_ns=lambda at_ns: 31 * MS if at_ns // POSE_NS % 7 == 3 else MS,
        answers_until_ns=3 * S,
    ).fly(13.0)
    assert np.abs(flight.errors_m()).max() < 0.3
    assert flight.silences_s().max() < 1.0


def test_a_clock_that_loses_time_again_and_again_places_fewer_returns_and_none_wrongly() -> None:
    flight = Flight(lost_ns=lambda at_ns: (at_ns // (1500 * MS)) * 120 * MS).fly(13.0)
    assert np.abs(flight.errors_m()).max() < 0.4
    assert len(flight.errors_m()) > 2000


@pytest.mark.parametrize("seed", range(5))
def test_an_autopilot_held_up_a_third_of_the_time_places_no_return_wrongly(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ticks = np.cumsum(np.column_stack([rng.integers(4, 60, 100), rng.integers(2, 30, 100)]).ravel())
    standing = np.zeros(ticks[-1] + 1, bool)
    for begin, end in zip(ticks[::2], ticks[1::2], strict=True):
        standing[begin:end] = True
    lost = np.concatenate([[0], np.cumsum(standing)]) * STEP_NS
    begun = 6 * S // STEP_NS
    flight = Flight(lost_ns=lambda at_ns: int(lost[at_ns // STEP_NS] - lost[begun]) * (at_ns >= 6 * S))
    errors_m = flight.fly(13.0).errors_m()
    assert np.abs(errors_m).max() < 0.4
    assert len(errors_m) > 300


def test_poses_of_a_link_that_becomes_slow_are_believed_after_half_a_second() -> None:
    flight = Flight(late_ns=lambda at_ns: 120 * MS if at_ns >= 9 * S else MS).fly(13.0)
    assert np.abs(flight.errors_m()).max() < 0.2
    assert flight.silences_s().max() < 0.6
    assert flight.scans[-1].stamp_ns[-1] > 12.7 * S
    assert flight.history.misdated == 0


def test_an_autopilot_that_tells_no_time_is_believed_by_its_quickest_messages() -> None:
    flight = Flight()
    flight.inbox.clock.timesync.request = lambda now_ns: None  # type: ignore[method-assign]
    assert len(flight.fly(13.0).errors_m()) > 5000
