"""Scripted ground station: waits for a position, sets GUIDED, arms, takes off, and then only monitors."""

from __future__ import annotations

from collections import deque
from enum import IntEnum
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.modes import Mode
from sitl.wire.message_signing import keep_time, sign
from sitl.wire.wire import MemoryWire

RETRY_NS = 1_000_000_000
CALLS = 64


class Pilot:
    """System 255 on a wire of its own; all its actions are MAVLink messages."""

    holding_modes: tuple[IntEnum, ...] = (Mode.LOITER, Mode.BRAKE, Mode.ALT_HOLD)

    def __init__(self, wire: MemoryWire, takeoff_height_m: float, key: bytes | None = None) -> None:
        self._wire = wire
        self._height_m = takeoff_height_m
        self._codec: Any = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self._codec.robust_parsing = True
        if key is not None:
            sign(self._codec, key, 0)
        self._next_ns = 0
        self._heartbeat_ns = 0
        self.mode = -1
        self.armed = False
        self.landed_state = mavlink.MAV_LANDED_STATE_UNDEFINED
        self.done = False
        self.heard: list[str] = []
        self.calls: deque[tuple[int, str]] = deque(maxlen=CALLS)
        """Component and text of the newest texts of severity CRITICAL or worse."""
        self.acks: list[tuple[int, int]] = []
        self.named_values: dict[str, float] = {}
        """Newest NAMED_VALUE_FLOAT of each name."""

    def on_tick(self, now_ns: int) -> None:
        """Read received messages, and advance the script."""
        for data in self._wire.received:
            for message in self._codec.parse_buffer(bytearray(data)) or []:
                self._read(message)
        self._wire.received.clear()
        if now_ns >= self._heartbeat_ns:
            self._heartbeat_ns = now_ns + RETRY_NS
            self.send(
                mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3
                )
            )
        if not self.done and now_ns >= self._next_ns:
            self._next_ns = now_ns + RETRY_NS
            self._script()

    def send(self, message: Any) -> None:
        """Send a message."""
        if self._codec.signing.sign_outgoing:
            keep_time(self._codec)
        self._wire.send(bytes(message.pack(self._codec)))
        self._codec.seq = (self._codec.seq + 1) % 256

    def command(self, number: int, *values: float, component: int = 1) -> None:
        """Send a COMMAND_LONG to the vehicle."""
        p = [*values, *[0.0] * (7 - len(values))]
        self.send(mavlink.MAVLink_command_long_message(1, component, number, 0, *p))

    def set_mode(self, mode: int) -> None:
        """Request a flight mode."""
        self.command(mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, int(mode))

    def _script(self) -> None:
        if self.landed_state == mavlink.MAV_LANDED_STATE_IN_AIR and self.armed:
            self.done = True
        elif self.mode != Mode.GUIDED:
            self.set_mode(Mode.GUIDED)
        elif not self.armed:
            self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        elif self.landed_state != mavlink.MAV_LANDED_STATE_TAKEOFF:
            self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, self._height_m)

    def _read(self, message: Any) -> None:
        kind = message.get_type()
        from_autopilot = message.get_srcComponent() == 1
        if kind == "HEARTBEAT" and from_autopilot:
            self.mode = message.custom_mode
            self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        elif kind == "EXTENDED_SYS_STATE" and from_autopilot:
            self.landed_state = message.landed_state
        elif kind == "STATUSTEXT":
            self.heard.append(str(message.text))
            if message.severity <= mavlink.MAV_SEVERITY_CRITICAL:
                self._call(message)
        elif kind == "NAMED_VALUE_FLOAT":
            self.named_values[message.name] = float(message.value)
        elif kind == "COMMAND_ACK":
            self.acks.append((message.command, message.result))

    def _call(self, message: Any) -> None:
        """Store a text, or append a chunk of a long one to the previous text of the same component."""
        component, text = message.get_srcComponent(), str(message.text)
        if message.chunk_seq and self.calls and self.calls[-1][0] == component:
            text = self.calls.pop()[1] + text
        self.calls.append((component, text))
