"""Simulated PX4 on the link's test bench, as far as the link and the doctor can distinguish it."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.link.autopilots.px4 import PX4
from companion.flight.link.wire.current_mode import CURRENT_MODE, MAVLink_current_mode_message
from tests.integration.link_bench import Autopilot

LOITER, OFFBOARD = 4 << 16 | 3 << 24, 6 << 16
MODE_S = 0.5
"""PX4 tells its mode so often, whatever interval was asked for; and when it changes."""
VERSION_1_17 = 1 << 24 | 17 << 16 | 0 << 8 | 255
LATER = frozenset({"MAN_OVERRIDE_SPD", "EAV_EN"})
"""What newer versions have."""


FENCE = {"GF_MAX_HOR_DIST": 0.0, "GF_MAX_VER_DIST": 0.0}  # none


def good_values() -> dict[str, float]:
    """Return what our parameter file sets in this version, by name."""
    return {row.name: row.value for row in PX4.required() if row.name not in LATER}


@dataclass
class Px4(Autopilot):
    """Heartbeat at 1 Hz whatever is asked, CURRENT_MODE unless it is an old one, parameters bit by bit.

    offers_mode: whether it has CURRENT_MODE. values: its parameters. lose: requests of a parameter that go
    unheard.
    """

    mode: int = LOITER
    offers_mode: bool = True
    version: int | None = VERSION_1_17
    values: dict[str, float] = field(default_factory=good_values)
    lose: dict[str, int] = field(default_factory=dict)

    def _heartbeat(self) -> Any:
        flags = 1 | (128 if self.armed else 0)
        return mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, flags, self.mode, 4, 3)

    def _stream(self, message_id: int) -> Any:
        if message_id == CURRENT_MODE:
            return MAVLink_current_mode_message(0, self.mode, self.mode)
        if message_id == mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED:
            return mavlink.MAVLink_local_position_ned_message(self.boot_ms, 1.0, 2.0, -12.0, 0.0, 0.0, 0.0)
        if message_id == mavlink.MAVLINK_MSG_ID_HOME_POSITION:
            return mavlink.MAVLink_home_position_message(
                470_000_000, 80_000_000, 400_000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0
            )
        if message_id == mavlink.MAVLINK_MSG_ID_GPS_RAW_INT:
            place = 470_000_000, 80_000_000, 412_000
            return mavlink.MAVLink_gps_raw_int_message(self.boot_ms * 1000, 3, *place, 80, 120, 0, 0, 14)
        if message_id == mavlink.MAVLINK_MSG_ID_SYS_STATUS:
            return mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 16_000, 0, 80, 0, 0, 0, 0, 0, 0)
        if message_id == mavlink.MAVLINK_MSG_ID_BATTERY_STATUS:
            cells = [4000] * 4 + [65535] * 6
            return mavlink.MAVLink_battery_status_message(0, 0, 0, 0, cells, 0, 0, 0, 80)
        return super()._stream(message_id)

    def hear(self, data: bytes) -> None:
        before = len(self.received)
        super().hear(data)
        for message in self.received[before:]:
            if message.get_type() == "PARAM_REQUEST_READ":
                self._parameter(message.param_id)
            elif message.get_type() == "MISSION_REQUEST_LIST":
                self.send(mavlink.MAVLink_mission_count_message(1, 191, 0, message.mission_type))

    def _command(self, m: Any) -> None:
        refused = m.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL and not self._has(int(m.param1))
        if m.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            refused = self.version is None or int(m.param1) != mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
            if not refused:
                self.send(_version(self.version or 0))
        if refused:
            self.send(mavlink.MAVLink_command_ack_message(m.command, mavlink.MAV_RESULT_FAILED))
            return
        if m.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL and int(m.param1) == CURRENT_MODE:
            self.intervals_s[CURRENT_MODE] = max(MODE_S, m.param2 * 1e-6)
            self.send(mavlink.MAVLink_command_ack_message(m.command, mavlink.MAV_RESULT_ACCEPTED))
            return
        super()._command(m)

    def _has(self, message_id: int) -> bool:
        if message_id == CURRENT_MODE:
            return self.offers_mode
        return message_id != mavlink.MAVLINK_MSG_ID_HEARTBEAT

    def _parameter(self, name: str) -> None:
        if self.lose.get(name, 0) > 0:
            self.lose[name] -= 1
            return
        values = FENCE | self.values
        if name not in values:
            return
        whole = next((row.integer for row in PX4.required() if row.name == name), None)
        value, kind = values[name], mavlink.MAV_PARAM_TYPE_REAL32
        if whole:
            value = struct.unpack("<f", struct.pack("<i", int(value)))[0]
            kind = mavlink.MAV_PARAM_TYPE_INT32
        self.send(mavlink.MAVLink_param_value_message(name.encode(), value, kind, 900, 0))


def _version(flight_sw: int) -> Any:
    nothing = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        0, flight_sw, 0, 0, 0, nothing, nothing, nothing, 0, 0, 0
    )
