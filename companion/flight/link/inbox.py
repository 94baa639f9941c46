"""Dispatcher of incoming MAVLink messages, without I/O: sender check, state update, events."""

from __future__ import annotations

import logging
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.clock.autopilot_clock import AutopilotClock
from companion.flight.link.clock.message_order import STAYS_MS, UNANSWERED_MS
from companion.flight.link.clock.timesync import answer
from companion.flight.link.command_server import CommandServer
from companion.flight.link.position_fix import PositionGate
from companion.flight.link.vehicle_identity import Candidate, VehicleIdentity
from companion.flight.link.vehicle_state import (
    Quaternion,
    Vector,
    VehicleState,
    is_autopilot,
    note_time,
    reduce,
)
from companion.flight.link.wire.codec import Codec
from companion.runtime.event import Event

log = logging.getLogger(__name__)


class Inbox:
    """Dispatcher that keeps the vehicle's state and clock, and reports changes as events.

    Only messages of the vehicle's autopilot count, component 1 of its system: other components of the same
    system, such as a gimbal, send their own attitude and state in the same messages.

    Parameters
    ----------
    identity
        Selects the system that is the vehicle. Poses are those of the candidate; answers and commands wait
        until the candidate is confirmed.
    gate
        Withholds the first positions until they are trusted.

    Attributes
    ----------
    vehicle
        Newest state of the vehicle, unknown until it is identified.
    foreign
        Number of messages from other senders that were not addressed to us.
    on_change
        Event (old, new) of the vehicle's state.
    on_attitude
        Event (stamp_ns, quat_wxyz, rates_rad_s): companion clock, body FRD to NED, body rates.
    on_position
        Event (stamp_ns, lat_deg, lon_deg, alt_msl_m, velocity_ned_ms): companion clock.
    on_certain
        Event (until_ns, mappings) before each pose: our time up to which stamps of poses are certain, and the
        number of times that those after it proved wrong, see `AutopilotClock`.
    on_reboot
        Event when the autopilot's clock restarted.
    """

    def __init__(
        self,
        codec: Codec,
        server: CommandServer,
        identity: VehicleIdentity | None = None,
        gate: PositionGate | None = None,
    ) -> None:
        self._codec = codec
        self._server = server
        self.identity = VehicleIdentity() if identity is None else identity
        self.gate = PositionGate() if gate is None else gate
        self.clock = AutopilotClock(salt=codec.component_id)
        self.vehicle = VehicleState()
        self._followed = VehicleState()
        self._bound = False
        self.foreign = 0
        self.on_answer: Event[[Any]] = Event()  # message to send as an answer
        self.on_reason: Event[[str, bool]] = Event()  # reason, and whether the command was accepted
        self.on_acknowledgement: Event[[Any, int]] = Event()
        self.on_heartbeat: Event[[]] = Event()
        self.on_reboot: Event[[]] = Event()
        self.on_change: Event[[VehicleState, VehicleState]] = Event()
        self.on_attitude: Event[[int, Quaternion, Vector]] = Event()
        self.on_position: Event[[int, float, float, float, Vector]] = Event()
        self.on_certain: Event[[int | None, int]] = Event()  # certain until; number of new mappings
        self.on_stranger: Event[[Candidate]] = Event()  # another vehicle, heard for the first time

    @property
    def followed(self) -> VehicleState:
        """Newest state of the vehicle, or of the candidate before it is confirmed."""
        return self.vehicle if self._bound else self._followed

    def on_message(self, message: Any, now_ns: int) -> bool:
        """Process a message; return whether the followed autopilot sent it."""
        self.confirm_vehicle(now_ns)
        kind = message.get_type()
        if kind in ("COMMAND_LONG", "COMMAND_INT") and self._command(message, now_ns):
            return False
        if kind == "HEARTBEAT":
            self._identify(message, now_ns)
        if not self.is_ours(message):
            self.foreign += 1
            return False
        if kind == "TIMESYNC":
            self._timesync(message, now_ns)
        elif kind == "COMMAND_ACK":
            self._acknowledgement(message, now_ns)
        else:
            self._reduce(message, now_ns)
        self.confirm_vehicle(now_ns)
        return True

    def confirm_vehicle(self, now_ns: int) -> None:
        """Confirm the followed system as the vehicle once it was the only one for long enough."""
        found = self._followed
        if self._bound or found.sysid is None or not self.identity.confirm(now_ns):
            return
        self._bound, old, self.vehicle = True, self.vehicle, found
        self._codec.system_id = found.sysid
        log.info("vehicle is system %d", found.sysid)
        self.on_heartbeat.emit()
        self.on_change.emit(old, found)

    def _identify(self, message: Any, now_ns: int) -> None:
        if not is_autopilot(message):
            return
        followed = self.identity.system
        stranger = self.identity.on_heartbeat(message, now_ns)
        if stranger is not None:
            log.warning("%s is heard too; ours is system %s", stranger, self.identity.system)
            self.on_stranger.emit(stranger)
        if followed is not None and self.identity.system != followed:
            self._followed = VehicleState()
            self.gate.close()
            self.clock.reset()
            self.on_reboot.emit()

    def is_ours(self, message: Any) -> bool:
        """Return whether the autopilot sent a message; only heartbeats reveal an impostor."""
        return bool(
            message.get_srcSystem() == self.identity.system
            and message.get_srcComponent() == mavlink.MAV_COMP_ID_AUTOPILOT1
            and (message.get_type() != "HEARTBEAT" or is_autopilot(message))
        )

    def _command(self, message: Any, now_ns: int) -> bool:
        result = self._server.handle_command(message, self._codec.system_id, self._codec.component_id, now_ns)
        if result is None:
            return False
        self.on_answer.emit(result.ack)
        if result.executed and result.reply.reason:
            self.on_reason.emit(result.reply.reason, result.reply.result == mavlink.MAV_RESULT_ACCEPTED)
        return True

    def _timesync(self, message: Any, now_ns: int) -> None:
        reply = answer(message.tc1, message.ts1, now_ns)
        if reply is None:
            if self.clock.timesync.reply(message.tc1, message.ts1, now_ns):
                new = note_time(self.followed, message.tc1 // 1_000_000 % 2**32, now_ns)
                self._follow(self.followed, new)
        elif self._bound:
            self.on_answer.emit(mavlink.MAVLink_timesync_message(*reply))

    def _acknowledgement(self, message: Any, now_ns: int) -> None:
        # Zero is broadcast; old autopilots omit the fields, which then decode as zero.
        if message.target_system in (0, self._codec.system_id) and message.target_component in (
            0,
            self._codec.component_id,
        ):
            self.on_acknowledgement.emit(message, now_ns)

    def _reduce(self, message: Any, now_ns: int) -> None:
        old = self.followed
        answered = self.clock.timesync.answered_ns is not None
        new = reduce(old, message, now_ns, UNANSWERED_MS if answered else STAYS_MS)
        if new is old:
            return
        self._follow(old, new, beats=message.get_type() == "HEARTBEAT")
        self._pose(old, new, message, now_ns)

    def _follow(self, old: VehicleState, new: VehicleState, beats: bool = False) -> None:
        """Keep a new state, and report it."""
        if new is old:
            return
        if self._bound:
            self.vehicle = new
        else:
            self._followed = new
        if new.order.other is not None:
            self.clock.timesync.hurry()  # its answer tells whether the autopilot restarted
        if new.reboots != old.reboots:
            log.warning("the autopilot rebooted")
            self.gate.close()
            self.clock.reset()
            self.on_reboot.emit()
        if self._bound:
            if beats:
                self.on_heartbeat.emit()
            self.on_change.emit(old, new)

    def _pose(self, old: VehicleState, new: VehicleState, message: Any, now_ns: int) -> None:
        """Emit the pose of a message; a new tuple object means that the message had a valid one."""
        if new.attitude_wxyz is not None and new.attitude_wxyz is not old.attitude_wxyz:
            stamp = self._stamp_ns(message, now_ns)
            if stamp is not None and new.rates_rad_s is not None:
                self.on_attitude.emit(stamp, new.attitude_wxyz, new.rates_rad_s)
        if new.position_lla is not None and new.position_lla is not old.position_lla:
            stamp = self._stamp_ns(message, now_ns)
            believed = self.gate.accepts(new.fix, now_ns)
            if believed and stamp is not None and new.velocity_ned_ms is not None:
                self.on_position.emit(stamp, *new.position_lla, new.velocity_ned_ms)

    def _stamp_ns(self, message: Any, now_ns: int) -> int | None:
        """Return our time of a pose; emit first up to when stamps are certain."""
        stamp = self.clock.stamp_ns(message.time_boot_ms, now_ns)
        self.on_certain.emit(self.clock.certain_ns, self.clock.mappings)
        return stamp
