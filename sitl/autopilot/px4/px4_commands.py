"""Handlers of the messages that PX4 takes otherwise than ArduCopter (Commander.cpp, mavlink_receiver.cpp)."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.commands import ACCEPTED, FORCE, UNSUPPORTED, Commands, Params
from sitl.autopilot.mission_items import MissionServer
from sitl.autopilot.px4.clock_offset import ClockOffset
from sitl.autopilot.px4.px4_failsafe import Px4Failsafes, Px4View
from sitl.autopilot.px4.px4_modes import Px4Mode, mode_of
from sitl.autopilot.px4.px4_parameters import TYPES, from_wire, is_settable, to_wire
from sitl.autopilot.px4.px4_telemetry import Px4Telemetry

REJECTED: int = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
CRITICAL = mavlink.MAV_SEVERITY_CRITICAL
CHANGES_MODE = 1


class Px4Commands(Commands):
    """Dispatcher of messages to PX4.

    Attributes
    ----------
    station_links
        Links on which a ground station was heard: texts go there alone (STATUSTEXT.hpp).
    """

    def __init__(
        self, autopilot: Px4View, telemetry: Px4Telemetry, failsafes: Px4Failsafes, missions: MissionServer
    ) -> None:
        super().__init__(autopilot, telemetry, failsafes, missions)
        self._px4 = autopilot
        self.station_links: set[int] = set()
        self._clocks: dict[int, ClockOffset] = {}
        self._names = sorted(TYPES)
        for name in ("SET_POSITION_TARGET_GLOBAL_INT", "REQUEST_DATA_STREAM"):
            del self._messages[name]
        for number in (
            mavlink.MAV_CMD_MISSION_START,  # missions are not simulated
            mavlink.MAV_CMD_CONDITION_YAW,
            mavlink.MAV_CMD_SET_EKF_SOURCE_SET,
        ):
            del self._commands[number]
        modes = {
            mavlink.MAV_CMD_NAV_LAND: Px4Mode.AUTO_LAND,  # whatever param2 asks
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: Px4Mode.AUTO_RTL,
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: Px4Mode.AUTO_LOITER,
        }
        for number, mode in modes.items():
            self._commands[number] = lambda p, link, mode=mode: self._change_to(mode)  # type: ignore[misc]
        self.needed = {
            number: needed
            for number, needed in self.needed.items()
            if number not in (mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_DO_REPOSITION)
        }

    # ---- modes --------------------------------------------------------------------------------------

    def _change_to(self, mode: Px4Mode | None) -> int:
        return ACCEPTED if mode is not None and self._px4.set_mode(mode) else REJECTED

    def _do_set_mode(self, p: Params, _link: int) -> int:
        if not int(p.p[0]) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return REJECTED
        return self._change_to(mode_of(p.p[1], p.p[2]))

    def _set_mode(self, message: Any, link: int) -> None:
        mode = mode_of(message.custom_mode >> 16 & 0xFF, message.custom_mode >> 24)
        ack = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_DO_SET_MODE, self._change_to(mode))
        self._px4.send(ack, link)

    def _arm(self, p: Params, _link: int) -> int:
        if p.p[0] not in (0, 1):
            return UNSUPPORTED
        reason = self._px4.arm() if p.p[0] else self._px4.disarm(force=p.p[1] == FORCE)
        if reason is None:
            return ACCEPTED
        self._px4.send_text(reason, CRITICAL)
        return REJECTED

    def _take_off(self, p: Params, _link: int) -> int:
        """Take off to a height above the sea, by default MIS_TAKEOFF_ALT above the vehicle."""
        up_m = p.z - self._px4.origin_lla[2]
        self._px4.navigator.takeoff_alt_m = up_m if math.isfinite(up_m) else None
        return self._change_to(Px4Mode.AUTO_TAKEOFF)

    def _reposition(self, p: Params, _link: int) -> int:
        """Hold at a place; its z is above the sea in every frame, NaN is unchanged (navigator_main.cpp)."""
        ap, estimate = self._px4, self._px4.estimate
        if int(p.p[1]) != CHANGES_MODE:
            return UNSUPPORTED
        if estimate is not None and ap.armed:
            place = ap.navigator.hold_place(estimate)
            if math.isfinite(p.x) and math.isfinite(p.y):
                place = ap.enu_m(p.x, p.y, ap.origin_lla[2])
                place[2] = estimate.pos_enu_m[2]
            if math.isfinite(p.z):
                place[2] = p.z - ap.origin_lla[2]
            ap.navigator.reposition(place)
        return self._change_to(Px4Mode.AUTO_LOITER)

    def _interval(self, p: Params, link: int) -> int:
        taken = self._telemetry.set_interval(link, int(p.p[0]), float(p.p[1]))
        return ACCEPTED if taken else mavlink.MAV_RESULT_FAILED

    # ---- setpoints, target and time -------------------------------------------------------------------

    def _local_target(self, message: Any, _link: int) -> None:
        ap = self._px4
        if ap.estimate is None:
            return
        flown = ap.mode is Px4Mode.OFFBOARD
        text = ap.navigator.offboard.receive(message, ap.estimate, ap.now_ns, in_control=flown)
        if text:
            ap.send_text(text, CRITICAL)

    def _landing_target(self, message: Any, link: int) -> None:
        ap = self._px4
        clock, now_us = self._clocks.setdefault(link, ClockOffset()), ap.boot_ns // 1000
        age_us = now_us - clock.local_us(message.time_usec, now_us)
        text = ap.navigator.precland.receive(message, ap.now_ns - 1000 * age_us)
        if text:
            ap.send_text(text, CRITICAL)

    def _timesync(self, message: Any, link: int) -> None:
        """Answer a question; learn the peer's clock from an answer."""
        if message.tc1 == 0:
            super()._timesync(message, link)
            return
        clock = self._clocks.setdefault(link, ClockOffset())
        clock.add(self._px4.boot_ns // 1000, message.tc1 // 1000, message.ts1 // 1000)

    def _heartbeat(self, message: Any, link: int) -> None:
        if message.type == mavlink.MAV_TYPE_GCS:
            self._failsafes.station_heard_ns = self._px4.now_ns
            self.station_links.add(link)

    def _override(self, message: Any, _link: int) -> None:
        channels = [getattr(message, f"chan{number}_raw") for number in range(1, 9)]
        self._px4.receiver.override(channels, self._px4.now_ns)

    # ---- parameters: integers by their bytes ------------------------------------------------------------

    def _param(self, name: str, link: int) -> None:
        value = to_wire(name, self._px4.parameters[name])
        self._px4.send(
            mavlink.MAVLink_param_value_message(
                name.encode(), value, TYPES[name], len(self._names), self._names.index(name)
            ),
            link,
        )

    def _param_list(self, _message: Any, link: int) -> None:
        for name in self._names:
            self._param(name, link)

    def _param_read(self, message: Any, link: int) -> None:
        name = message.param_id
        if 0 <= message.param_index < len(self._names):
            name = self._names[message.param_index]
        if name in TYPES:
            self._param(name, link)

    def _param_set(self, message: Any, link: int) -> None:
        name = message.param_id
        if name not in TYPES:
            return
        value = from_wire(name, message.param_value, message.param_type)
        if value is not None and is_settable(name, value):
            self._px4.parameters[name] = value
        self._param(name, link)
