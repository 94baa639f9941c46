"""Messages of an odometry: clocks, publishers, order, and what is counted."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest

from companion.flight.fusion.external_odometry.external_pose import Drop, ExternalPose
from companion.flight.fusion.external_odometry.odometry_clock import OdometryClock
from companion.flight.fusion.external_odometry.pose_stream import PoseStream
from tests.unit.companion.flight.fusion.external_odometry.odometry_messages import Told

MS, S = 1_000_000, 1_000_000_000
WALL_NS = 1_700_000_000 * S  # UTC less the companion's clock
CLOUDS_NS = -7_000 * S  # the companion's clock less that of the clouds


class Listener:
    """A stream, and what comes of it."""

    def __init__(self, clouds_ns: int | None = None) -> None:
        self.clouds_ns = clouds_ns
        self.poses: list[ExternalPose] = []
        self.drops: Counter[Drop] = Counter()
        clock = OdometryClock(self._cloud_offset_ns, lambda: WALL_NS)
        self.stream = PoseStream(clock, self.poses.append, self._count)

    def take(self, told: Told, arrival_ns: int) -> None:
        self.stream.add_packet(told.packet(), arrival_ns)

    def _cloud_offset_ns(self, stamp_ns: int) -> int | None:
        near = self.clouds_ns is not None and abs(stamp_ns + self.clouds_ns - 10 * S) < 5 * S
        return self.clouds_ns if near else None

    def _count(self, reason: Drop, _at_ns: int) -> None:
        self.drops[reason] += 1


def message(at_ns: int, number: int = 1, **more: object) -> Told:
    """Return a message of a time of the companion's clock, stamped with the time of day."""
    told = Told(WALL_NS + at_ns, (number * 0.1, 0.0, 0.0), number=number)
    return replace(told, **more)  # type: ignore[arg-type]


def test_stamps_of_the_time_of_day_keep_the_age_of_the_pose() -> None:
    listener = Listener()
    listener.take(message(10 * S), 10 * S + 80 * MS)
    listener.take(message(10 * S + 100 * MS, 2), 10 * S + 400 * MS)
    assert [pose.stamp_ns for pose in listener.poses] == [10 * S, 10 * S + 100 * MS]


def test_stamps_of_the_clouds_are_mapped_as_these() -> None:
    listener = Listener(CLOUDS_NS)
    listener.take(replace(message(0), stamp_ns=10 * S - CLOUDS_NS), 10 * S + 80 * MS)
    assert [pose.stamp_ns for pose in listener.poses] == [10 * S]


@pytest.mark.parametrize("off_ns", [-600 * MS, 50 * MS, 3600 * S, -(WALL_NS - S)])
def test_stamps_of_another_clock_are_dropped(off_ns: int) -> None:
    listener = Listener()
    listener.take(message(10 * S + off_ns), 10 * S)
    assert listener.drops == {Drop.OTHER_CLOCK: 1}
    assert not listener.poses


def test_what_comes_twice_or_late_or_stands_still_is_dropped() -> None:
    listener = Listener()
    listener.take(message(10 * S, 1), 10 * S)
    listener.take(message(10 * S, 2), 10 * S)
    listener.take(message(10 * S - 50 * MS, 3), 10 * S)
    assert listener.drops == {Drop.DISORDERED: 2}
    frozen = replace(message(0, 4), position_m=(0.1, 0.0, 0.0))
    for k in range(1, 4):
        listener.take(replace(frozen, stamp_ns=WALL_NS + 10 * S + k * MS), 10 * S + k * MS)
    assert listener.drops[Drop.REPEATED] == 3
    assert len(listener.poses) == 1


def test_another_publisher_is_used_when_the_first_is_silent() -> None:
    listener, other = Listener(), b"another node's ID"[:16]
    listener.take(message(10 * S, 1), 10 * S)
    listener.take(message(10 * S + 100 * MS, 1, gid=other), 10 * S + 100 * MS)
    assert listener.drops == {Drop.FOREIGN: 1}
    listener.take(message(13 * S, 7, gid=other), 13 * S)
    assert [pose.publisher for pose in listener.poses][1] == other.hex()
    assert listener.stream.lost == 0


def test_missing_numbers_are_counted_as_lost() -> None:
    listener = Listener()
    for k, number in enumerate((5, 6, 9)):
        listener.take(message(10 * S + k * MS, number), 10 * S + k * MS)
    assert (listener.stream.messages, listener.stream.lost) == (3, 2)


def test_a_recording_gets_every_message_as_it_came() -> None:
    listener, kept = Listener(), []
    listener.stream.batches.subscribe(kept.append)
    listener.stream.add_packet(b"no message", 5)
    listener.take(message(10 * S), 10 * S)
    assert kept == [[(5, b"no message")], [(10 * S, message(10 * S).packet())]]
    assert listener.drops == {Drop.MALFORMED: 1}
