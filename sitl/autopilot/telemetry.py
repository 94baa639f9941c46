"""Telemetry scheduler of the simulated autopilot: message intervals per link, and message factories."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.autopilot_view import AutopilotView
from sitl.autopilot.failsafe import Failsafes
from sitl.autopilot.modes import Mode
from sitl.autopilot.status_messages import StatusMessages
from sitl.vehicle.multirotor import GRAVITY_MS2
from sitl.vehicle.rigid_body import ned, rotate, to_euler

ID = mavlink

# Default intervals in ms: ArduPilot's streams at 4 Hz, status at 1 Hz.
DEFAULT_MS = {
    ID.MAVLINK_MSG_ID_HEARTBEAT: 1000,
    ID.MAVLINK_MSG_ID_SYS_STATUS: 1000,
    ID.MAVLINK_MSG_ID_ATTITUDE: 250,
    ID.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 250,
    ID.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 250,
    ID.MAVLINK_MSG_ID_VFR_HUD: 250,
    ID.MAVLINK_MSG_ID_GPS_RAW_INT: 500,
    ID.MAVLINK_MSG_ID_GPS2_RAW: 500,
    ID.MAVLINK_MSG_ID_SYSTEM_TIME: 1000,
    ID.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1000,
    ID.MAVLINK_MSG_ID_BATTERY_STATUS: 1000,
    ID.MAVLINK_MSG_ID_EKF_STATUS_REPORT: 500,
    ID.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 500,
    ID.MAVLINK_MSG_ID_WIND: 1000,
    ID.MAVLINK_MSG_ID_RC_CHANNELS: 500,
    ID.MAVLINK_MSG_ID_FENCE_STATUS: 1000,
    ID.MAVLINK_MSG_ID_TIMESYNC: 10_000,
    ID.MAVLINK_MSG_ID_HOME_POSITION: 10_000,
    ID.MAVLINK_MSG_ID_MISSION_CURRENT: 1000,
}
_STREAMS = {
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (
        ID.MAVLINK_MSG_ID_SYS_STATUS,
        ID.MAVLINK_MSG_ID_GPS_RAW_INT,
        ID.MAVLINK_MSG_ID_GPS2_RAW,
        ID.MAVLINK_MSG_ID_FENCE_STATUS,
    ),
    mavlink.MAV_DATA_STREAM_RC_CHANNELS: (ID.MAVLINK_MSG_ID_RC_CHANNELS,),
    mavlink.MAV_DATA_STREAM_POSITION: (
        ID.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        ID.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA1: (ID.MAVLINK_MSG_ID_ATTITUDE,),
    mavlink.MAV_DATA_STREAM_EXTRA2: (ID.MAVLINK_MSG_ID_VFR_HUD,),
    mavlink.MAV_DATA_STREAM_EXTRA3: (
        ID.MAVLINK_MSG_ID_SYSTEM_TIME,
        ID.MAVLINK_MSG_ID_BATTERY_STATUS,
        ID.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
        ID.MAVLINK_MSG_ID_WIND,
    ),
}
# type_mask of POSITION_TARGET_LOCAL_NED in ArduCopter's submodes of GUIDED; always without yaw and its rate.
_POSITION_ONLY, _VELOCITY_ONLY, _POSITION_AND_VELOCITY = 0xDF8, 0xC07, 0xC00
UTC_AT_ZERO_US = 1_750_000_000_000_000


class Telemetry:
    """Message intervals per link, and a factory for each message."""

    default_ms: Mapping[int, int] = DEFAULT_MS

    def __init__(self, autopilot: AutopilotView, failsafes: Failsafes) -> None:
        self._ap = autopilot
        self._due: dict[int, dict[int, list[int]]] = {}
        self._next_ns = 0
        self._makers: dict[int, Callable[[], Any]] = {
            **StatusMessages(autopilot, failsafes).makers,
            ID.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            ID.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: self._attitude_quaternion,
            ID.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position,
            ID.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
            ID.MAVLINK_MSG_ID_VFR_HUD: self._vfr_hud,
            ID.MAVLINK_MSG_ID_SYSTEM_TIME: self._system_time,
            ID.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._extended_state,
            ID.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: self._position_target,
            ID.MAVLINK_MSG_ID_TIMESYNC: self._timesync,
            ID.MAVLINK_MSG_ID_HOME_POSITION: self._home,
            ID.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self._origin,
            ID.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._version,
            ID.MAVLINK_MSG_ID_SIM_STATE: self._sim_state,
            ID.MAVLINK_MSG_ID_MISSION_CURRENT: self._mission_current,
        }

    @property
    def numbers(self) -> tuple[int, ...]:
        """IDs of the messages it can send."""
        return tuple(self._makers)

    # ---- intervals ----------------------------------------------------------------------------------

    def add_link(self, link: int, now_ns: int) -> None:
        """Start the default streams on a new link."""
        if link not in self._due:
            made = ((number, ms) for number, ms in self.default_ms.items() if number in self._makers)
            self._due[link] = {number: [ms * 1_000_000, now_ns] for number, ms in made}
            self._next_ns = 0

    def restart(self) -> None:
        """Discard every link and its requested intervals."""
        self._due.clear()

    def set_interval(self, link: int, number: int, interval_us: float) -> bool:
        """Set a stream's interval: 0 the default, -1 off."""
        if number not in self._makers:
            return False
        default = self.default_ms.get(number)
        streams = self._due.setdefault(link, {})
        if interval_us < 0 or (interval_us == 0 and default is None):
            streams.pop(number, None)
        else:
            ns = int(interval_us * 1000) if interval_us > 0 else int(default or 0) * 1_000_000
            streams[number] = [ns, self._ap.now_ns]
        self._next_ns = 0
        return True

    def data_stream(self, link: int, stream: int, rate_hz: int, start: int) -> None:
        """Serve the deprecated REQUEST_DATA_STREAM."""
        groups = _STREAMS.values() if stream == mavlink.MAV_DATA_STREAM_ALL else [_STREAMS.get(stream, ())]
        for number in (number for group in groups for number in group):
            self.set_interval(link, number, 1e6 / rate_hz if start and rate_hz else -1)

    def due_now(self, number: int) -> None:
        """Send a message to every link with the next batch."""
        for streams in self._due.values():
            if number in streams:
                streams[number][1] = 0
        self._next_ns = 0

    def send_once(self, number: int, link: int) -> bool:
        """Send a message to one link; return whether it is known and available now."""
        maker = self._makers.get(number)
        message = None if maker is None or self._ap.estimate is None else maker()
        if message is not None:
            self._ap.send(message, link)
        return message is not None

    def emit(self, now_ns: int) -> None:
        """Queue all due messages."""
        if now_ns < self._next_ns or self._ap.estimate is None:
            return
        soonest = now_ns + 1_000_000_000
        made: dict[int, Any] = {}
        for link, streams in self._due.items():
            for number, entry in streams.items():
                interval, due = entry
                if due <= now_ns:
                    if number not in made:
                        made[number] = self._makers[number]()
                    if made[number] is not None:
                        self._ap.send(made[number], link)
                    entry[1] = max(due + interval, now_ns + interval // 2)
                soonest = min(soonest, entry[1])
        self._next_ns = soonest

    # ---- messages -----------------------------------------------------------------------------------

    @property
    def _boot_ms(self) -> int:
        """Time since boot of the estimate being sent."""
        return self._ap.estimate_boot_ns // 1_000_000

    def _estimate(self) -> Any:
        return self._ap.estimate

    def _attitude(self) -> Any:
        e = self._estimate()
        return mavlink.MAVLink_attitude_message(self._boot_ms, *to_euler(e.quat_wxyz), *e.rates_frd_rad_s)

    def _attitude_quaternion(self) -> Any:
        e = self._estimate()
        return mavlink.MAVLink_attitude_quaternion_message(
            self._boot_ms, *(float(v) for v in e.quat_wxyz), *(float(v) for v in e.rates_frd_rad_s)
        )

    def _geodetic(self) -> tuple[int, int, int, int]:
        ap = self._ap
        lat, lon, alt = ap.lla(self._estimate().pos_enu_m)
        return round(lat * 1e7), round(lon * 1e7), round(alt * 1000), round(ap.height_above_home_m * 1000)

    def _heading_cdeg(self) -> int:
        return round(math.degrees(to_euler(self._estimate().quat_wxyz)[2]) * 100) % 36000

    def _global_position(self) -> Any:
        v = self._estimate().vel_enu_ms
        return mavlink.MAVLink_global_position_int_message(
            self._boot_ms, *self._geodetic(), *(round(float(x) * 100) for x in (v[1], v[0], -v[2])),
            self._heading_cdeg(),
        )  # fmt: skip

    def _local_position(self) -> Any:
        e = self._estimate()
        p, v = e.pos_enu_m, e.vel_enu_ms
        return mavlink.MAVLink_local_position_ned_message(
            self._boot_ms, *(float(x) for x in (p[1], p[0], -p[2], v[1], v[0], -v[2]))
        )

    def _vfr_hud(self) -> Any:
        e = self._estimate()
        speed = math.hypot(float(e.vel_enu_ms[0]), float(e.vel_enu_ms[1]))
        _, _, alt_mm, _ = self._geodetic()
        return mavlink.MAVLink_vfr_hud_message(
            speed, speed, self._heading_cdeg() // 100, 40, alt_mm / 1000, float(e.vel_enu_ms[2])
        )

    def _system_time(self) -> Any:
        ap = self._ap
        return mavlink.MAVLink_system_time_message(
            UTC_AT_ZERO_US + ap.now_ns // 1000, ap.boot_ns // 1_000_000
        )

    def _extended_state(self) -> Any:
        ap = self._ap
        landed = mavlink.MAV_LANDED_STATE_IN_AIR if ap.airborne else mavlink.MAV_LANDED_STATE_ON_GROUND
        if ap.airborne and ap.navigator.is_landing(ap.mode):
            landed = mavlink.MAV_LANDED_STATE_LANDING
        elif ap.airborne and ap.navigator.is_taking_off(ap.mode):
            landed = mavlink.MAV_LANDED_STATE_TAKEOFF
        return mavlink.MAVLink_extended_sys_state_message(ap.airframe.vtol_state, landed)

    def _position_target(self) -> Any | None:
        """Return what GUIDED follows; None in another mode.

        As in ArduCopter, a velocity is the one that avoidance leaves, and a position comes without one.
        """
        ap, guided = self._ap, self._ap.navigator.guided
        if ap.mode is not Mode.GUIDED:
            return None
        up_m, position, velocity = ap.navigator.takeoff_up_m, guided.position_enu_m, np.zeros(3)
        if up_m is not None:
            position = np.array([*ap.navigator.hold_enu_m[:2], up_m])
        elif guided.entered:
            position = None
        elif guided.velocity_enu_ms is not None:
            velocity = ap.target_enu_ms if position is None else guided.velocity_enu_ms
        mask = _POSITION_ONLY if guided.velocity_enu_ms is None else _POSITION_AND_VELOCITY
        if position is None:
            mask, position = _VELOCITY_ONLY, np.zeros(3)
        return mavlink.MAVLink_position_target_local_ned_message(
            self._boot_ms, mavlink.MAV_FRAME_LOCAL_NED, mask,
            *(float(v) for v in (position[1], position[0], -position[2])),
            *(float(v) for v in (velocity[1], velocity[0], -velocity[2])),
            0.0, 0.0, 0.0, 0.0, 0.0,
        )  # fmt: skip

    def _mission_current(self) -> Any | None:
        """Return MISSION_CURRENT; None without a mission."""
        legs, leg = self._ap.navigator.mission.legs, self._ap.navigator.mission.current
        if not legs:
            return None
        return mavlink.MAVLink_mission_current_message(legs[-1].number if leg is None else leg.number)

    def _timesync(self) -> Any:
        return mavlink.MAVLink_timesync_message(0, self._ap.boot_ns)

    def _home(self) -> Any:
        home = self._ap.navigator.home_enu_m
        lat, lon, alt = self._ap.lla(home)
        return mavlink.MAVLink_home_position_message(
            round(lat * 1e7), round(lon * 1e7), round(alt * 1000),
            float(home[1]), float(home[0]), -float(home[2]), [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0,
        )  # fmt: skip

    def _origin(self) -> Any:
        lat, lon, alt = self._ap.origin_lla
        return mavlink.MAVLink_gps_global_origin_message(
            round(lat * 1e7), round(lon * 1e7), round(alt * 1000)
        )

    def _version(self) -> Any:
        capabilities = (
            mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
            | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
            | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
            | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
            | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
        )
        nothing = [0] * 8
        return mavlink.MAVLink_autopilot_version_message(
            capabilities, 0x04060000, 0, 0, 0, nothing, nothing, nothing, 0, 0, 42, [0] * 18
        )

    def _sim_state(self) -> Any:
        """Return SIM_STATE, the ground truth, which only a simulator has.

        As in ArduPilot, accelerations are the specific force in the body frame, and the floats lat and lon
        are degrees times 1e7, although the message's definition says degrees.
        """
        truth = self._ap.truth_source() if self._ap.truth_source else self._estimate()
        lat, lon, alt = self._ap.lla(truth.pos_enu_m)
        roll, pitch, yaw = to_euler(truth.quat_wxyz)
        felt = truth.acc_enu_ms2 + np.array([0.0, 0.0, GRAVITY_MS2])
        body = rotate(truth.quat_wxyz * np.array([1.0, -1.0, -1.0, -1.0]), ned(felt))
        v = truth.vel_enu_ms
        return mavlink.MAVLink_sim_state_message(
            *(float(x) for x in truth.quat_wxyz), roll, pitch, yaw,
            *(float(x) for x in body), *(float(x) for x in truth.rates_frd_rad_s),
            lat * 1e7, lon * 1e7, alt, 0.0, 0.0, float(v[1]), float(v[0]), -float(v[2]),
            round(lat * 1e7), round(lon * 1e7),
        )  # fmt: skip
