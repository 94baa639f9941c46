"""What each incoming message means for us, without I/O: who sent it, what it changes, what it calls for."""

from __future__ import annotations

import logging
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.autopilot_clock import AutopilotClock
from companion.link.codec import Codec
from companion.link.event import Event
from companion.link.operator import CommandServer
from companion.link.timesync import answer
from companion.link.vehicle import Quaternion, Vector, VehicleState, is_autopilot, reduce

log = logging.getLogger(__name__)


class Inbox:
    """Reads the wire: keeps the vehicle's state and clock, and says what happens as events.

    The first autopilot heard is the vehicle for as long as the program runs: on a shared network another one
    must never be commanded in its place.

    Attributes
    ----------
    vehicle
        Newest state.
    foreign
        Messages of others that were not for us.
    """

    def __init__(self, codec: Codec, server: CommandServer) -> None:
        self._codec = codec
        self._server = server
        self.clock = AutopilotClock(salt=codec.component_id)
        self.vehicle = VehicleState()
        self.foreign = 0
        self._strangers: set[int] = set()
        self.outgoing: Event[[Any]] = Event()  # message to send in answer
        self.reason: Event[[str, bool]] = Event()  # why an operator's command was (not) accepted
        self.acknowledged: Event[[Any, int]] = Event()
        self.heartbeat: Event[[]] = Event()
        self.rebooted: Event[[]] = Event()
        self.changed: Event[[VehicleState, VehicleState]] = Event()
        self.attitude: Event[[int, Quaternion, Vector]] = Event()
        self.position: Event[[int, float, float, float, Vector]] = Event()
        self.certain: Event[[int | None, int]] = Event()  # up to when stamps are; how often they were mended

    def take(self, message: Any, now_ns: int) -> bool:
        """Take a message; return whether the vehicle's autopilot sent it."""
        kind = message.get_type()
        if kind in ("COMMAND_LONG", "COMMAND_INT") and self._command(message, now_ns):
            return False
        if self.vehicle.sysid is None and is_autopilot(message):
            self._codec.system_id = message.get_srcSystem()
            log.info("vehicle is system %d", message.get_srcSystem())
        elif not self._is_ours(message):
            self._stranger(message)
            return False
        if kind == "TIMESYNC":
            self._timesync(message, now_ns)
        elif kind == "COMMAND_ACK":
            self._acknowledgement(message, now_ns)
        else:
            self._state(message, now_ns)
        return True

    def _is_ours(self, message: Any) -> bool:
        return bool(
            message.get_srcSystem() == self.vehicle.sysid
            and message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1
        )

    def _stranger(self, message: Any) -> None:
        self.foreign += 1
        system = message.get_srcSystem()
        if self.vehicle.sysid is not None and system != self.vehicle.sysid and is_autopilot(message):
            if system not in self._strangers:
                log.warning("autopilot of system %d ignored; ours is %d", system, self.vehicle.sysid)
            self._strangers.add(system)

    def _command(self, message: Any, now_ns: int) -> bool:
        result = self._server.take(message, self._codec.system_id, self._codec.component_id, now_ns)
        if result is None:
            return False
        self.outgoing.emit(result.ack)
        if result.executed and result.reply.reason:
            self.reason.emit(result.reply.reason, result.reply.result == mavlink.MAV_RESULT_ACCEPTED)
        return True

    def _timesync(self, message: Any, now_ns: int) -> None:
        reply = answer(message.tc1, message.ts1, now_ns)
        if reply is None:
            self.clock.timesync.reply(message.tc1, message.ts1, now_ns)
        else:
            self.outgoing.emit(mavlink.MAVLink_timesync_message(*reply))

    def _acknowledgement(self, message: Any, now_ns: int) -> None:
        # Zero is everybody; old autopilots leave the fields out, which reads as zero.
        if message.target_system in (0, self._codec.system_id) and message.target_component in (
            0,
            self._codec.component_id,
        ):
            self.acknowledged.emit(message, now_ns)

    def _state(self, message: Any, now_ns: int) -> None:
        old = self.vehicle
        new = self.vehicle = reduce(old, message, now_ns)
        if new is old:
            return
        if new.reboots != old.reboots:
            log.warning("the autopilot rebooted")
            self.clock.reset()
            self.rebooted.emit()
        if message.get_type() == "HEARTBEAT":
            self.heartbeat.emit()
        self.changed.emit(old, new)
        self._pose(old, new, message, now_ns)

    def _pose(self, old: VehicleState, new: VehicleState, message: Any, now_ns: int) -> None:
        """Hand on the pose of a message: a tuple that is another object was in it, and was valid."""
        if new.attitude_wxyz is not None and new.attitude_wxyz is not old.attitude_wxyz:
            stamp = self._stamp_ns(message, now_ns)
            if stamp is not None and new.rates_rad_s is not None:
                self.attitude.emit(stamp, new.attitude_wxyz, new.rates_rad_s)
        if new.position_lla is not None and new.position_lla is not old.position_lla:
            stamp = self._stamp_ns(message, now_ns)
            if stamp is not None and new.velocity_ned_ms is not None:
                self.position.emit(stamp, *new.position_lla, new.velocity_ned_ms)

    def _stamp_ns(self, message: Any, now_ns: int) -> int | None:
        """Return our time of a pose; first tell how far stamps are certain."""
        stamp = self.clock.stamp_ns(message.time_boot_ms, now_ns)
        self.certain.emit(self.clock.certain_ns, self.clock.mappings)
        return stamp
