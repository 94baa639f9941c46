"""Feed of a telemetry log and separately recorded LiDAR points, merged by their times of day."""

from __future__ import annotations

import heapq
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from operator import itemgetter
from typing import Any, Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.desk.replay.foreign_replay import Act, Rerun
from companion.desk.replay.recorded_sensors import ORDERS
from companion.desk.replay.recorder_clock import ClockStep, ContinuousTime, RecorderClock
from companion.desk.replay.telemetry_log import Logged, TelemetryLog
from companion.flight.link.command_server import CommandServer
from companion.flight.link.inbox import Inbox
from companion.flight.link.position_fix import PositionGate
from companion.flight.link.vehicle_identity import VehicleIdentity
from companion.flight.link.wire.codec import Codec
from companion.flight.link.wire.repeated_frames import RepeatedFrames

AUTOPILOT: int = mavlink.MAV_COMP_ID_AUTOPILOT1


class LoggedPoints(Protocol):
    """LiDAR measurements of a flight that has a log."""

    @property
    def cut(self) -> str:
        """Reason for the missing end, empty where it is complete; known at the end."""

    @property
    def bad(self) -> int:
        """Number of unreadable parts."""

    def summary(self) -> dict[str, Any]:
        """Return the chosen sources and the counts, for JSON."""

    def steps(self, rerun: Rerun, clock_steps: Sequence[ClockStep]) -> Iterator[tuple[int, Act]]:
        """Yield every part in order: its time of day (ns), and the call that hands it over.

        clock_steps: of the recorder's clock; the times are those of that clock at its end.
        """


class TelemetryFeed:
    """Feed of FLIGHT.tlog and its points; both are on the recorder's clock, as it was at the end.

    Parameters
    ----------
    system
        ID of the vehicle, None if the log holds none.
    tells_fix
        The log states whether positions can be trusted.
    """

    def __init__(
        self, log: TelemetryLog, points: LoggedPoints, system: int | None = None, tells_fix: bool = False
    ) -> None:
        self._log = log
        self._points = points
        self._system = system
        self._gate = PositionGate(sys.maxsize if tells_fix else 0)
        self._repeated = RepeatedFrames()
        self._clock_steps = clock_steps(log, system)
        self._inbox: Inbox | None = None

    @property
    def cut(self) -> str:
        return "; ".join(filter(None, (self._log.cut, self._points.cut)))

    @property
    def bad(self) -> int:
        return self._log.bad + self._points.bad

    def summary(self) -> dict[str, Any]:
        old = 0 if self._inbox is None else self._inbox.followed.order.old
        counts = {
            "system": self._system,
            "positions_without_fix": self._gate.refused,
            "frames_repeated": self._repeated.copies,
            "messages_late": old,
            "clock_steps": [asdict(step) for step in self._clock_steps],
        }
        return counts | self._points.summary()

    def steps(self, rerun: Rerun) -> Iterator[tuple[int, Act]]:
        self._repeated = RepeatedFrames()
        inbox = self._inbox = Inbox(
            Codec(rerun.parameters.component_id), CommandServer(), VehicleIdentity(self._system), self._gate
        )
        inbox.on_attitude.subscribe(rerun.history.add_attitude)
        inbox.on_position.subscribe(rerun.history.add_position)
        inbox.on_reboot.subscribe(rerun.history.clear)
        hear = _LogHandler(inbox, rerun)
        heard = (
            (logged.at_ns, partial(hear, logged))
            for logged in self._messages()
            if not self._repeated.is_copy(logged.message, logged.at_ns)
        )
        return heapq.merge(heard, self._points.steps(rerun, self._clock_steps), key=itemgetter(0))

    def _messages(self) -> Iterator[Logged]:
        recorded = ContinuousTime(self._clock_steps)
        for logged in self._log.messages():
            yield replace(logged, at_ns=recorded(logged.at_ns))


def clock_steps(log: TelemetryLog, system: int | None) -> tuple[ClockStep, ...]:
    """Return the steps of the recorder's clock by the time of the vehicle's autopilot."""
    clock = RecorderClock()
    for logged in log.only(
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    ):
        if (logged.message.get_srcSystem(), logged.message.get_srcComponent()) == (system, AUTOPILOT):
            clock.note(logged.message, logged.at_ns)
    return clock.steps()


class _LogHandler:
    """Handler of logged messages; without quaternions in the log it converts ATTITUDE's angles."""

    def __init__(self, inbox: Inbox, rerun: Rerun) -> None:
        self._inbox, self._rerun = inbox, rerun
        self._quaternions = False  # only the autopilot's: a gimbal's are not the vehicle's attitude

    def __call__(self, logged: Logged) -> None:
        message, kind = logged.message, logged.message.get_type()
        if kind in ORDERS:
            return
        ours = self._inbox.is_ours(message)
        if ours and kind == "ATTITUDE_QUATERNION":
            self._quaternions = True
        elif ours and kind == "ATTITUDE" and not self._quaternions:
            message = quaternion_of(message)
        self._inbox.on_message(message, logged.at_ns)
        self._rerun.standing = self._inbox.vehicle.landed == "on_ground"


def quaternion_of(message: Any) -> Any:
    """Convert ATTITUDE to ATTITUDE_QUATERNION of the same sender: yaw, pitch, roll about z, y, x."""
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
