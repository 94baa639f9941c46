"""Reader of MAVLink telemetry logs of ground stations: repeated pairs of a time of day and a frame.

The time is microseconds since 1970 in eight bytes, big-endian; a recorder without a clock begins in 1970.
"""

from __future__ import annotations

import mmap
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.vehicle_identity import NAME_IT, VehicleIdentity, several
from companion.flight.link.vehicle_state import is_autopilot
from companion.flight.link.wire.framing import message_id
from companion.runtime.errors import UsageError

STAMP = struct.Struct(">Q")
LATEST_US = 4 * 10**15  # 2096
V1, V2 = 0xFE, 0xFD
V1_FRAME, V2_FRAME, SIGNATURE = 8, 12, 13  # bytes beside the payload
SIGNED = 0x01


@dataclass(frozen=True, slots=True)
class Logged:
    """Logged message. at_ns: reception by the ground station, since 1970."""

    at_ns: int
    message: Any


class TelemetryLog:
    """A .tlog file.

    Attributes
    ----------
    bad
        Number of frames and stretches that could not be read.
    cut
        Reason for the missing end, or empty; known once all was read.

    Raises
    ------
    UsageError
        It cannot be read or holds no frame.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.bad = 0
        self.cut = ""
        if next(self.messages(), None) is None:
            raise UsageError(f"{path}: it is no MAVLink telemetry log")

    def messages(self) -> Iterator[Logged]:
        """Yield the messages in the order of the file."""
        yield from self._all(None)

    def only(self, *message_ids: int) -> Iterator[Logged]:
        """Yield the messages of some types, which is much quicker than all."""
        yield from self._all(frozenset(message_ids))

    def _all(self, only: frozenset[int] | None) -> Iterator[Logged]:
        self.bad, self.cut = 0, ""
        try:
            with (
                self._path.open("rb") as file,
                mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data,
            ):
                yield from self._read(data, only)
        except OSError as error:
            raise UsageError(f"{self._path}: cannot be read: {error.strerror or error}") from None
        except ValueError:  # raised by mmap
            raise UsageError(f"{self._path}: it is empty") from None

    def _read(self, data: mmap.mmap, only: frozenset[int] | None) -> Iterator[Logged]:
        decoder = mavlink.MAVLink(None)
        at, lost = 0, False
        while at + STAMP.size < len(data):
            length = _frame_bytes(data, at)
            if length is None:
                self.bad += not lost
                at, lost = at + 1, True
                continue
            end = at + STAMP.size + length
            if end > len(data):
                self.cut = f"{self._path.name} ends in the middle"
                return
            frame = data[at + STAMP.size : end]
            if not lost and only is not None and message_id(frame) not in only:
                at = end
                continue
            message = _decoded(decoder, frame)
            if message is None:
                self.bad += not lost
                at, lost = (at + 1, True) if lost else (end, False)
                continue
            (at_us,) = STAMP.unpack_from(data, at)
            if only is None or message.get_msgId() in only:
                yield Logged(at_us * 1000, message)
            at, lost = end, False
        if at < len(data) and not lost:
            self.cut = f"{self._path.name} ends in the middle"


def _frame_bytes(data: mmap.mmap, at: int) -> int | None:
    """Return the length of the frame after the stamp at `at`; None if there is none."""
    head = data[at : at + STAMP.size + 3]
    (at_us,) = STAMP.unpack_from(head)
    if at_us >= LATEST_US or len(head) < STAMP.size + 3:
        return None
    magic, payload, flags = head[STAMP.size :]
    if magic == V1:
        return int(payload) + V1_FRAME
    if magic == V2:
        return int(payload) + V2_FRAME + (SIGNATURE if flags & SIGNED else 0)
    return None


def _decoded(decoder: Any, frame: bytes) -> Any:
    """Return the message of a frame; None if it is damaged or unknown to the dialect."""
    try:
        return decoder.decode(bytearray(frame))
    except (mavlink.MAVError, struct.error, ValueError, TypeError):
        return None


def vehicle_of(path: Path, log: TelemetryLog, named: int | None) -> int | None:
    """Return the system ID of a log's only aircraft, or the named one; None if there is none.

    Raises
    ------
    UsageError
        The log holds two aircraft and none was named, no aircraft at all, or not the named system.
    """
    identity = VehicleIdentity(named, listen_ns=sys.maxsize)
    for logged in log.only(mavlink.MAVLINK_MSG_ID_HEARTBEAT):
        if is_autopilot(logged.message):
            identity.on_heartbeat(logged.message, logged.at_ns)
    heard = identity.candidates | identity.passed_over
    if named is not None and named not in heard:
        others = ", ".join(map(str, heard.values())) or "none"
        raise UsageError(f"{path}: it holds no autopilot of system {named}; of others: {others}")
    if identity.ambiguous:
        raise UsageError(f"{path}: {several(identity.candidates.values())}")
    if identity.system is None and heard:
        names = " and ".join(map(str, heard.values()))
        raise UsageError(f"{path}: it holds no aircraft, only {names}: {NAME_IT}")
    return identity.system


def tells_fix(log: TelemetryLog, system: int | None) -> bool:
    """Return whether the vehicle's autopilot reports the quality of its position in a log."""
    said = log.only(
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_GPS2_RAW,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
    )
    ours = (system, mavlink.MAV_COMP_ID_AUTOPILOT1)
    return any((m.message.get_srcSystem(), m.message.get_srcComponent()) == ours for m in said)
