"""Poses of one external odometry on the companion's clock, from its messages; without I/O."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

from companion.flight.fusion.external_odometry.external_pose import Drop, ExternalPose
from companion.flight.fusion.external_odometry.odometry_clock import OdometryClock
from companion.flight.fusion.external_odometry.odometry_decoder import HEAD_BYTES, decode
from companion.flight.rmw import attachment
from companion.runtime.event import Event

log = logging.getLogger(__name__)

SILENT_NS = 2_000_000_000
STUCK = 1  # repeated to the last bit: the program stands still, not the vehicle
Batch = list[tuple[int, bytes]]


class PoseStream:
    """Checks, time stamps and decoding of the messages.

    It uses one publisher, the first, until that has been silent for two seconds.

    Parameters
    ----------
    clock
        Mapping of the stamps.
    on_pose
        Called with every pose, its stamp on the companion's clock.
    on_drop
        Called with the reason for each message that is not used, and its arrival.

    Attributes
    ----------
    batches
        Event of each message, before it is decoded; for a recording.
    messages, lost
        Messages in use, and those missing by the publisher's numbers.
    """

    def __init__(
        self,
        clock: OdometryClock,
        on_pose: Callable[[ExternalPose], None],
        on_drop: Callable[[Drop, int], None],
    ) -> None:
        self._clock, self._on_pose, self._on_drop = clock, on_pose, on_drop
        self.batches: Event[[Batch]] = Event()
        self.messages = self.lost = 0
        self._publisher, self._arrival_ns = "", 0
        self._number: int | None = None
        self._last: ExternalPose | None = None
        self._repeats = 0
        self._said: set[Drop] = set()

    def add_packet(self, packet: bytes, arrival_ns: int) -> None:
        """Take a message, an attachment of 33 bytes before it; an unusable one is counted and dropped."""
        self.batches.emit([(arrival_ns, packet)])
        found = decode(packet)
        if isinstance(found, ExternalPose):
            found = self._accept(found, arrival_ns)
        self._count_lost(packet)
        if isinstance(found, ExternalPose):
            self.messages += 1
            self._on_pose(found)
            return
        if found not in self._said:
            self._said.add(found)
            log.warning("a message of the odometry is not used: %s", found.words)
        self._on_drop(found, arrival_ns)

    def _accept(self, pose: ExternalPose, arrival_ns: int) -> ExternalPose | Drop:
        """Return the pose on the companion's clock, or the reason why it is not used."""
        if pose.publisher != self._publisher:
            if self._publisher and arrival_ns - self._arrival_ns < SILENT_NS:
                return Drop.FOREIGN
            log.info("odometry of the publisher %s: %s to %s", pose.publisher, pose.child, pose.frame)
            self._publisher, self._number, self._last = pose.publisher, None, None
        self._arrival_ns = arrival_ns
        stamp_ns = self._clock.map(pose.stamp_ns, arrival_ns)
        if stamp_ns is None:
            return Drop.OTHER_CLOCK
        last, pose = self._last, replace(pose, stamp_ns=stamp_ns)
        if last is not None and stamp_ns <= last.stamp_ns:
            return Drop.DISORDERED
        self._last = pose
        same = last is not None and _bits(last) == _bits(pose)
        self._repeats = self._repeats + 1 if same else 0
        return Drop.REPEATED if self._repeats >= STUCK else pose

    def _count_lost(self, packet: bytes) -> None:
        head = attachment.unpack(packet[:HEAD_BYTES])
        if head is None or head.gid.hex() != self._publisher:
            return
        if self._number is not None:
            self.lost += max(0, head.number - self._number - 1)
        self._number = head.number


def _bits(pose: ExternalPose) -> tuple[bytes, bytes]:
    return pose.position_m.tobytes(), pose.rotation.tobytes()
