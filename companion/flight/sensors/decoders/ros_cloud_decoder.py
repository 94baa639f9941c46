"""Decoder of ROS messages sensor_msgs/PointCloud2 (CDR) with rmw_zenoh's attachment before them."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import ClassVar

from companion.flight.rmw import attachment
from companion.flight.rmw.message_types import message_types
from companion.flight.sensors.decoders.point_clock import PointClock
from companion.flight.sensors.decoders.point_cloud import (
    BadCloudError,
    Decoded,
    StampedCloud,
    clock_of,
    decode,
    table_of,
)
from companion.flight.sensors.returns import RawReturns, Returns, join, nothing

log = logging.getLogger(__name__)

CLOUD = "sensor_msgs/msg/PointCloud2"
INSTANT = "instant"
JUDGED_CLOUDS = 10  # as many show what the times of the points mean
MOST_BYTES = 32 << 20
MOST_NS = 2**62
PLACED = frozenset({"map", "odom", "world", "earth"})  # REP 105, and RViz's habit: no sensor's axes
HEAD_BYTES = 33


@dataclass(slots=True)
class CloudCounters:
    """Counters of received and dropped data.

    packets: clouds. lost_packets: by the publisher's numbers. placed: clouds in the map's axes. judged:
    clouds from which the meaning of the points' times was inferred. untimed: clouds whose points have no
    usable times. false_times: points whose time is far from their cloud's.
    """

    packets: int = 0
    malformed: int = 0
    lost_packets: int = 0
    placed: int = 0
    judged: int = 0
    untimed: int = 0
    returns: int = 0
    no_return: int = 0
    false_times: int = 0


class RosCloudDecoder:
    """Decoder of clouds; a packet is an attachment of 33 bytes and a message.

    The first ten clouds show the unit and epoch of the points' times and are not used. Clouds without usable
    times are dropped, as a sweep of a tenth of a second at one time is misplaced by a metre at 10 m/s.

    Parameters
    ----------
    metadata
        "instant" for a camera or a flash LiDAR: all points of a cloud are of its stamp.
    """

    kind: ClassVar[str] = "ros2"

    def __init__(self, metadata: str = "") -> None:
        self.metadata = metadata
        self.counters = CloudCounters()
        self._clock: PointClock | None = None
        self._judged: list[StampedCloud] = []
        self._checked: tuple[bytes, Decoded] | None = None
        self._stored: list[Returns] = []
        self._number: tuple[bytes, int] | None = None
        self._said: set[str] = set()

    def __len__(self) -> int:
        """Return the number of stored clouds."""
        return len(self._stored)

    def check(self, packet: bytes) -> int | None:
        """Return the time of a cloud's last point (ns since 1970); None, counted by reason, if useless."""
        self._checked = None
        try:
            cloud = _cloud(packet)
        except Exception as error:  # the library's generated code may raise anything
            self.counters.malformed += 1
            self._say("malformed", "it is malformed: " + " ".join(f"{error or type(error).__name__}".split()))
            return None
        if cloud.frame.lstrip("/") in PLACED:
            self.counters.placed += 1
            self._say("placed", f"its points are in the frame {cloud.frame!r}, not in the sensor's axes")
            return None
        found = self._decoded(cloud)
        if found is None:
            return None
        self._checked = packet, found
        stamps_ns = found.returns.stamp_ns
        return int(stamps_ns[-1]) if len(stamps_ns) else cloud.stamp_ns

    def add_packet(self, packet: bytes) -> None:
        """Store the cloud that was checked last."""
        if self._checked is None or self._checked[0] is not packet:
            return
        found, self._checked = self._checked[1], None
        counters = self.counters
        counters.packets += 1
        counters.returns += len(found.returns)
        counters.no_return += found.no_return
        counters.false_times += found.false_times
        self._count_lost(packet)
        self._stored.append(found.returns)

    def drain(self) -> RawReturns:
        """Return the points of the stored clouds, on the clock of their stamps."""
        if not self._stored:
            return nothing()
        all_of, self._stored = join(self._stored), []
        return RawReturns(
            all_of.xyz_sensor_m,
            all_of.stamp_ns,
            all_of.intensity,
            all_of.ring,
            all_of.echo,
            all_of.echoes,
            has_thin_rays=self.metadata != INSTANT,
        )

    def _decoded(self, cloud: StampedCloud) -> Decoded | None:
        """Return the points with their times; None, counted, while their meaning is unknown."""
        if self.metadata == INSTANT:
            return decode(cloud.table, cloud.stamp_ns, None)
        if self._clock is not None:
            found = decode(cloud.table, cloud.stamp_ns, self._clock)
            if found.timed:
                self._judged.clear()
                return found
            self.counters.untimed += 1
        self._judged.append(cloud)
        if self._clock is None:
            self.counters.judged += 1
        if len(self._judged) >= JUDGED_CLOUDS:
            self._judge()
        return None

    def _judge(self) -> None:
        verdict = clock_of(self._judged)
        if isinstance(verdict, PointClock):
            self._clock = verdict
            log.info("times of the points: %s", verdict)
        else:
            if self._clock is None:
                self.counters.judged -= len(self._judged)
                self.counters.untimed += len(self._judged)
            self._say(
                "untimed",
                f"{verdict}: let the driver write them, or add ?{INSTANT} if all points of a cloud are of one"
                " instant",
            )
        self._judged.clear()

    def _count_lost(self, packet: bytes) -> None:
        head = attachment.unpack(packet[:HEAD_BYTES])
        if head is None:
            return
        if self._number is not None and self._number[0] == head.gid:
            self.counters.lost_packets += max(0, head.number - self._number[1] - 1)
        self._number = head.gid, head.number

    def _say(self, reason: str, text: str) -> None:
        """Log the first cloud that is dropped for a reason."""
        if reason not in self._said:
            self._said.add(reason)
            log.error("a cloud is not used: %s", text[:200])


def _cloud(packet: bytes) -> StampedCloud:
    """Return the cloud in a packet.

    Raises
    ------
    Exception
        It is none.
    """
    if attachment.unpack(packet[:HEAD_BYTES]) is None:
        raise BadCloudError("it has no attachment of rmw_zenoh")
    if len(packet) > MOST_BYTES:
        raise BadCloudError(f"it has {len(packet)} bytes")
    message = message_types().deserialise(packet[HEAD_BYTES:], CLOUD)
    stamp = message.header.stamp
    stamp_ns = int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
    if not 0 < stamp_ns < MOST_NS:
        raise BadCloudError(f"its stamp is {stamp_ns} ns")
    return StampedCloud(stamp_ns, str(message.header.frame_id), table_of(message))
