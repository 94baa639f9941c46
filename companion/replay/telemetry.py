"""A telemetry log and a capture of the LiDAR's packets, aligned by the time of day of both."""

from __future__ import annotations

import heapq
import math
from collections import Counter
from collections.abc import Iterator
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.errors import UsageError
from companion.link.codec import Codec
from companion.link.inbox import Inbox
from companion.link.operator import CommandServer
from companion.replay.pcap import Capture, Datagram
from companion.replay.rerun import Act, Rerun
from companion.replay.senses import ORDERS
from companion.replay.tlog import Logged, TelemetryLog
from companion.sensors.driver import BATCH_PACKETS, decoder_for, description
from companion.sensors.lookalike import lookalike
from companion.sensors.stream import PacketStream

LOOKED_AT = 2000  # datagrams, to tell the sensor
BATCH_NS = 10_000_000


class TelemetryFeed:
    """A flight from FLIGHT.tlog and FILE.pcap.

    Parameters
    ----------
    lidar
        Kind of the sensor as in its URL, `ouster?meta=FILE` with its description; None: told by its packets.

    Raises
    ------
    UsageError
        A file cannot be used, or the sensor is not known.
    """

    def __init__(self, log: Path, capture: Path, lidar: str | None) -> None:
        self._log = TelemetryLog(log)
        self._capture = Capture(capture)
        kind, _, query = (lidar or self._kind(capture)).partition("?")
        self._kind_told = kind
        try:
            self._setup = description(kind, query)
        except UsageError as error:
            raise UsageError(f"--lidar {lidar}: {error}") from None
        decoder_for(kind, self._setup)
        self._stream: PacketStream | None = None

    @property
    def cut(self) -> str:
        return self._log.cut or self._capture.cut

    @property
    def bad(self) -> int:
        return self._log.bad + self._capture.bad

    def told(self) -> dict[str, Any]:
        packets = {} if self._stream is None else self._stream.statistics()
        return {"lidar": self._kind_told, "packets": packets, "no_udp": self._capture.other}

    def steps(self, rerun: Rerun) -> Iterator[tuple[int, Act]]:
        p = rerun.parameters
        inbox = Inbox(Codec(p.component_id), CommandServer())
        inbox.attitude.subscribe(rerun.history.add_attitude)
        inbox.position.subscribe(rerun.history.add_position)
        decoder = decoder_for(self._kind_told, self._setup)
        stream = self._stream = PacketStream(decoder, p, rerun.add_returns, lambda: 0)  # all is time of day
        hear = _Ear(inbox, rerun)
        see = _Eye(stream)
        both: Iterator[Logged | Datagram] = heapq.merge(
            self._log.messages(), self._capture.datagrams(), key=lambda datum: datum.at_ns
        )
        at_ns = 0
        for datum in both:
            at_ns = datum.at_ns
            yield at_ns, partial(hear, datum) if isinstance(datum, Logged) else partial(see, datum)
        yield at_ns, partial(stream.flush, at_ns)

    def _kind(self, path: Path) -> str:
        """Return the kind of sensor that most packets are of."""
        kinds = Counter(lookalike(datagram.data) for datagram in islice(self._capture.datagrams(), LOOKED_AT))
        n_udp = kinds.total()
        del kinds[None]
        if not kinds:
            raise UsageError(
                f"{path}: none of its first {n_udp} UDP packets is of a known LiDAR: name it by --lidar"
            )
        return str(kinds.most_common(1)[0][0])


class _Ear:
    """Hears the vehicle; a log without quaternions has angles, which say the same."""

    def __init__(self, inbox: Inbox, rerun: Rerun) -> None:
        self._inbox, self._rerun = inbox, rerun
        self._quaternions = False

    def __call__(self, logged: Logged) -> None:
        message, kind = logged.message, logged.message.get_type()
        if kind in ORDERS:
            return
        if kind == "ATTITUDE_QUATERNION":
            self._quaternions = True
        elif kind == "ATTITUDE" and not self._quaternions:
            message = quaternion_of(message)
        self._inbox.take(message, logged.at_ns)
        self._rerun.standing = self._inbox.vehicle.landed == "on_ground"


class _Eye:
    """Sees the packets, decoded in batches as the driver does."""

    def __init__(self, stream: PacketStream) -> None:
        self._stream = stream
        self._flushed_ns = 0

    def __call__(self, datagram: Datagram) -> None:
        self._stream.take(datagram.data, datagram.host, datagram.at_ns)
        if len(self._stream) >= BATCH_PACKETS or datagram.at_ns - self._flushed_ns >= BATCH_NS:
            self._stream.flush(datagram.at_ns)
            self._flushed_ns = datagram.at_ns


def quaternion_of(message: Any) -> Any:
    """Return ATTITUDE as ATTITUDE_QUATERNION of the same sender: yaw, pitch, roll about z, y, x."""
    (cr, sr), (cp, sp), (cy, sy) = (
        (math.cos(angle / 2), math.sin(angle / 2)) for angle in (message.roll, message.pitch, message.yaw)
    )
    new = mavlink.MAVLink_attitude_quaternion_message(
        message.time_boot_ms,
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        message.rollspeed,
        message.pitchspeed,
        message.yawspeed,
    )
    new._header = message.get_header()
    return new
