"""Telemetry of PX4: its streams, and the messages that differ from ArduCopter's."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.px4.current_mode_message import CURRENT_MODE, CurrentMode
from sitl.autopilot.px4.px4_failsafe import Px4Failsafes, Px4View
from sitl.autopilot.px4.px4_modes import AUTO, MANUAL, Px4Mode
from sitl.autopilot.telemetry import DEFAULT_MS, Telemetry

ID = mavlink

ABSENT = (
    ID.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    ID.MAVLINK_MSG_ID_WIND,
    ID.MAVLINK_MSG_ID_FENCE_STATUS,
    ID.MAVLINK_MSG_ID_SIM_STATE,
    ID.MAVLINK_MSG_ID_MISSION_CURRENT,
)
MODE_NS = 500_000_000  # period of vehicle_status without a change
SILENCED_US = 300  # intervals up to this are acknowledged, and nothing comes
VERSION = 1 << 24 | 17 << 16 | 255  # 1.17.0, a release
WIND_VARIANCE = 0.25


class Px4Telemetry(Telemetry):
    """Streams of PX4's onboard link, at lower rates by default."""

    default_ms = {number: ms for number, ms in DEFAULT_MS.items() if number not in ABSENT} | {
        CURRENT_MODE: 500,
        ID.MAVLINK_MSG_ID_TIMESYNC: 100,
        ID.MAVLINK_MSG_ID_WIND_COV: 500,
        ID.MAVLINK_MSG_ID_MANUAL_CONTROL: 500,
        ID.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: 100,
        ID.MAVLINK_MSG_ID_HOME_POSITION: 2000,
    }

    def __init__(self, autopilot: Px4View, failsafes: Px4Failsafes) -> None:
        super().__init__(autopilot, failsafes)
        self._px4, self._states = autopilot, failsafes
        for number in ABSENT:
            self._makers.pop(number, None)
        self._makers |= {
            ID.MAVLINK_MSG_ID_HEARTBEAT: self._heartbeat,
            CURRENT_MODE: self._current_mode,
            ID.MAVLINK_MSG_ID_WIND_COV: self._wind,
            ID.MAVLINK_MSG_ID_MANUAL_CONTROL: self._manual_control,
            ID.MAVLINK_MSG_ID_HIL_STATE_QUATERNION: self._truth,
        }

    def set_interval(self, link: int, number: int, interval_us: float) -> bool:
        """Set a stream's interval: 0 the default, -1 off. HEARTBEAT keeps its 1 Hz."""
        if number == ID.MAVLINK_MSG_ID_HEARTBEAT:
            return False
        if 0 < interval_us <= SILENCED_US:
            interval_us = -1
        if number == CURRENT_MODE and interval_us > 0:
            interval_us = max(interval_us, MODE_NS / 1000)
        return super().set_interval(link, number, interval_us)

    # ---- mode and state -----------------------------------------------------------------------------

    def _heartbeat(self) -> Any:
        """Return HEARTBEAT (streams/HEARTBEAT.hpp)."""
        ap = self._px4
        flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        flags |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if ap.armed else 0
        flags |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED if ap.mode in MANUAL else 0
        flags |= mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED if ap.mode is not Px4Mode.MANUAL else 0
        if ap.mode in AUTO:
            flags |= mavlink.MAV_MODE_FLAG_AUTO_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
        if ap.armed:
            failsafe = self._states.actions.in_failsafe
            state = mavlink.MAV_STATE_CRITICAL if failsafe else mavlink.MAV_STATE_ACTIVE
        else:
            state = mavlink.MAV_STATE_STANDBY if ap.position_ok else mavlink.MAV_STATE_UNINIT
        return mavlink.MAVLink_heartbeat_message(
            ap.airframe.kind.value, mavlink.MAV_AUTOPILOT_PX4, flags, int(ap.mode), state, 3
        )

    def _current_mode(self) -> Any:
        mode = Px4Mode(self._px4.mode)
        return CurrentMode(mode.standard, int(mode), int(self._px4.intended))

    def _extended_state(self) -> Any:
        """Return EXTENDED_SYS_STATE: LANDING while the setpoint is a landing (EXTENDED_SYS_STATE.hpp)."""
        ap, setpoint = self._px4, self._px4.navigator.setpoint
        landed = mavlink.MAV_LANDED_STATE_IN_AIR if ap.airborne else mavlink.MAV_LANDED_STATE_ON_GROUND
        if ap.airborne and setpoint is not None:
            if ap.navigator.is_landing(ap.mode):
                landed = mavlink.MAV_LANDED_STATE_LANDING
            elif ap.navigator.is_taking_off(ap.mode):
                landed = mavlink.MAV_LANDED_STATE_TAKEOFF
        return mavlink.MAVLink_extended_sys_state_message(ap.airframe.vtol_state, landed)

    def _position_target(self) -> Any | None:
        """Return what the position controller follows; None where the motors are off."""
        ap = self._px4
        if not ap.armed:
            return None
        offboard, setpoint = ap.navigator.offboard, ap.navigator.setpoint
        position = np.full(3, np.nan)
        if ap.mode is Px4Mode.OFFBOARD:
            position = offboard.position_enu_m
        elif setpoint is not None:
            position = setpoint.place_enu_m.copy()
            position[2] = np.nan if ap.navigator.is_landing(ap.mode) else position[2]
        ned = [float(v) for v in (position[1], position[0], -position[2])]
        v = ap.target_enu_ms
        mask = sum(1 << axis for axis, value in enumerate(ned) if math.isnan(value))
        return mavlink.MAVLink_position_target_local_ned_message(
            self._boot_ms, mavlink.MAV_FRAME_LOCAL_NED, mask, *ned,
            float(v[1]), float(v[0]), -float(v[2]), 0.0, 0.0, 0.0, 0.0, 0.0,
        )  # fmt: skip

    # ---- others -------------------------------------------------------------------------------------

    def _wind(self) -> Any | None:
        wind = self._px4.wind.wind_ned_ms
        if wind is None:
            return None
        north, east, _ = (float(v) for v in wind)
        up_m = self._px4.lla(self._estimate().pos_enu_m)[2]
        return mavlink.MAVLink_wind_cov_message(
            self._px4.estimate_boot_ns // 1000, north, east, 0.0, WIND_VARIANCE, 0.0, up_m, 0.0, 0.0
        )

    def _manual_control(self) -> Any | None:
        """Return MANUAL_CONTROL; None without sticks (MANUAL_CONTROL.hpp)."""
        ap = self._px4
        if self._states.radio:
            return None
        sticks = ap.receiver.sticks(ap.now_ns)
        ahead, right, turn = (round(1000 * v) for v in (sticks.forward, sticks.right, sticks.clockwise))
        return mavlink.MAVLink_manual_control_message(1, ahead, right, round(500 * (sticks.up + 1)), turn, 0)

    def _version(self) -> Any:
        capabilities = (
            mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_UNION
            | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
        )
        nothing = [0] * 8
        return mavlink.MAVLink_autopilot_version_message(
            capabilities, VERSION, 0, 0, 0, nothing, nothing, nothing, 0, 0, 42, [0] * 18
        )

    def _truth(self) -> Any:
        """Return HIL_STATE_QUATERNION, the ground truth, which only a simulator has."""
        truth = self._px4.truth_source() if self._px4.truth_source else self._estimate()
        lat, lon, alt = self._px4.lla(truth.pos_enu_m)
        east, north, up = (round(100 * float(v)) for v in truth.vel_enu_ms)
        return mavlink.MAVLink_hil_state_quaternion_message(
            self._px4.boot_ns // 1000, [float(v) for v in truth.quat_wxyz],
            *(float(v) for v in truth.rates_frd_rad_s), round(lat * 1e7), round(lon * 1e7), round(alt * 1000),
            north, east, -up, 0, 0, 0, 0, 0,
        )  # fmt: skip
