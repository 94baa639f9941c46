"""Handlers of the MAVLink messages that the simulated autopilot receives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.autopilot_view import AutopilotView
from sitl.autopilot.failsafe import Failsafes
from sitl.autopilot.mission_items import MissionServer
from sitl.autopilot.modes import GuidedTarget, Mode
from sitl.autopilot.parameters import in_range
from sitl.autopilot.telemetry import Telemetry
from sitl.vehicle.rigid_body import rotate, to_euler

F64 = NDArray[np.float64]

ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
DENIED: int = mavlink.MAV_RESULT_DENIED
FAILED: int = mavlink.MAV_RESULT_FAILED
UNSUPPORTED: int = mavlink.MAV_RESULT_UNSUPPORTED

FORCE = 21196
_RELATIVE = (
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
    mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
)
_GLOBAL = (*_RELATIVE, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
_FROM_VEHICLE = (
    mavlink.MAV_FRAME_LOCAL_OFFSET_NED,
    mavlink.MAV_FRAME_BODY_NED,
    mavlink.MAV_FRAME_BODY_OFFSET_NED,
)
_IGNORE_POSITION, _IGNORE_VELOCITY, _IGNORE_YAW, _IGNORE_YAW_RATE = 0b111, 0b111000, 1 << 10, 1 << 11


# Parameters that must be numbers, counted from 1; elsewhere NaN means "unchanged", and many stations send it.
_NEEDED: dict[int, tuple[int, ...]] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: (1,),
    mavlink.MAV_CMD_DO_SET_MODE: (1, 2),
    mavlink.MAV_CMD_NAV_TAKEOFF: (7,),
    mavlink.MAV_CMD_DO_REPOSITION: (2, 5, 6, 7),
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: (1, 2),
    mavlink.MAV_CMD_REQUEST_MESSAGE: (1,),
    mavlink.MAV_CMD_DO_SET_HOME: (1,),
    mavlink.MAV_CMD_CONDITION_YAW: (1, 3, 4),
    mavlink.MAV_CMD_SET_EKF_SOURCE_SET: (1,),
}
HIGHEST_M = 100_000.0


class Params:
    """Parameters 1 to 7 of COMMAND_LONG or COMMAND_INT, with x and y in degrees or metres."""

    def __init__(self, message: Any) -> None:
        self.p = (message.param1, message.param2, message.param3, message.param4)
        self.relative = True
        if message.get_type() == "COMMAND_INT":
            scale = 1e-7 if message.frame in _GLOBAL else 1e-4
            self.x, self.y, self.z = message.x * scale, message.y * scale, message.z
            self.relative = message.frame in _RELATIVE
        else:
            self.x, self.y, self.z = message.param5, message.param6, message.param7

    def numbers(self, needed: tuple[int, ...]) -> bool:
        """Return whether these parameters, counted from 1, are finite."""
        values = (*self.p, self.x, self.y, self.z)
        return all(math.isfinite(values[i - 1]) for i in needed)

    @property
    def is_place(self) -> bool:
        """True if x, y and z are a latitude, a longitude and an altitude."""
        return _is_place(self.x, self.y, self.z)


def _is_place(lat_deg: float, lon_deg: float, alt_m: float) -> bool:
    return abs(lat_deg) <= 90 and abs(lon_deg) <= 180 and abs(alt_m) <= HIGHEST_M


class Commands:
    """Dispatcher of messages to the autopilot."""

    needed: Mapping[int, tuple[int, ...]] = _NEEDED

    def __init__(
        self, autopilot: AutopilotView, telemetry: Telemetry, failsafes: Failsafes, missions: MissionServer
    ) -> None:
        self._ap, self._telemetry, self._failsafes = autopilot, telemetry, failsafes
        self._messages: dict[str, Callable[[Any, int], None]] = {
            "COMMAND_LONG": self._command,
            "COMMAND_INT": self._command,
            "SET_MODE": self._set_mode,
            "SET_POSITION_TARGET_LOCAL_NED": self._local_target,
            "SET_POSITION_TARGET_GLOBAL_INT": self._global_target,
            "LANDING_TARGET": self._landing_target,
            "DISTANCE_SENSOR": self._distance_sensor,
            "OBSTACLE_DISTANCE": self._obstacle_distance,
            "OBSTACLE_DISTANCE_3D": self._obstacle_distance_3d,
            "ODOMETRY": self._odometry,
            "VISION_POSITION_ESTIMATE": self._vision_position,
            "VISION_SPEED_ESTIMATE": self._vision_speed,
            "TIMESYNC": self._timesync,
            "HEARTBEAT": self._heartbeat,
            "RC_CHANNELS_OVERRIDE": self._override,
            "PARAM_REQUEST_LIST": self._param_list,
            "PARAM_REQUEST_READ": self._param_read,
            "PARAM_SET": self._param_set,
            **missions.handlers,
            "REQUEST_DATA_STREAM": self._data_stream,
        }
        self._commands: dict[int, Callable[[Params, int], int]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm,
            mavlink.MAV_CMD_DO_SET_MODE: self._do_set_mode,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mavlink.MAV_CMD_NAV_LAND: lambda p, link: self._enter(Mode.LAND),
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda p, link: self._enter(Mode.RTL),
            mavlink.MAV_CMD_MISSION_START: self._start_mission,
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: lambda p, link: self._enter(Mode.LOITER),
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._interval,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request,
            mavlink.MAV_CMD_GET_HOME_POSITION: self._get_home,
            mavlink.MAV_CMD_DO_SET_HOME: self._set_home,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._capabilities,
            mavlink.MAV_CMD_CONDITION_YAW: self._condition_yaw,
            mavlink.MAV_CMD_SET_EKF_SOURCE_SET: self._source_set,
        }

    def receive(self, message: Any, link: int) -> None:
        """Process a message; unknown ones are ignored, as an autopilot does."""
        handler = self._messages.get(message.get_type())
        if handler is not None:
            handler(message, link)

    # ---- commands -----------------------------------------------------------------------------------

    def _command(self, message: Any, link: int) -> None:
        handler = self._commands.get(message.command)
        p = Params(message)
        if handler is None:
            result = UNSUPPORTED
        elif not p.numbers(self.needed.get(message.command, ())):
            result = DENIED
        else:
            result = handler(p, link)
        self._ap.send(
            mavlink.MAVLink_command_ack_message(
                message.command, result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
            ),
            link,
        )

    def _refuse(self, reason: str | None) -> int:
        if reason is None:
            return ACCEPTED
        self._ap.send_text(reason, mavlink.MAV_SEVERITY_CRITICAL)
        return FAILED

    def _arm(self, p: Params, _link: int) -> int:
        if p.p[0] == 1:
            return self._refuse(self._ap.arm())
        if p.p[0] == 0:
            return self._refuse(self._ap.disarm(force=p.p[1] == FORCE))
        return DENIED

    def _enter(self, mode: Mode) -> int:
        return ACCEPTED if self._ap.set_mode(mode) else FAILED

    def _start_mission(self, p: Params, _link: int) -> int:
        return DENIED if p.p[0] or p.p[1] else self._enter(Mode.AUTO)

    def _do_set_mode(self, p: Params, _link: int) -> int:
        if not int(p.p[0]) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return DENIED
        try:
            mode = Mode(int(p.p[1]))
        except ValueError:
            return FAILED
        return self._enter(mode)

    def _set_mode(self, message: Any, link: int) -> None:
        try:
            result = self._enter(Mode(message.custom_mode))
        except ValueError:
            result = FAILED
        self._ap.send(mavlink.MAVLink_command_ack_message(mavlink.MAVLINK_MSG_ID_SET_MODE, result), link)

    def _take_off(self, p: Params, _link: int) -> int:
        if not 0 < p.z <= HIGHEST_M:
            return self._refuse("Takeoff: needs a height above home")
        return self._refuse(self._ap.take_off(float(p.z)))

    def _reposition(self, p: Params, _link: int) -> int:
        """Fly to a point; enter GUIDED if param2 allows it."""
        if not p.is_place:
            return DENIED
        if self._ap.mode is not Mode.GUIDED and not (int(p.p[1]) & 1 and self._ap.set_mode(Mode.GUIDED)):
            return DENIED
        self._ap.navigator.guided = GuidedTarget(self._point(p.x, p.y, p.z, relative=p.relative))
        return ACCEPTED

    def _point(self, lat: float, lon: float, alt: float, *, relative: bool) -> F64:
        home = self._ap.navigator.home_enu_m
        point = self._ap.enu_m(lat, lon, self._ap.origin_lla[2])
        point[2] = float(home[2]) + alt if relative else alt - self._ap.origin_lla[2]
        return point

    def _interval(self, p: Params, link: int) -> int:
        interval_us = float(p.p[1])
        if 0 < interval_us < 4999:  # above 200 Hz is denied
            return DENIED
        return ACCEPTED if self._telemetry.set_interval(link, int(p.p[0]), interval_us) else DENIED

    def _request(self, p: Params, link: int) -> int:
        return ACCEPTED if self._telemetry.send_once(int(p.p[0]), link) else FAILED

    def _get_home(self, _p: Params, link: int) -> int:
        self._telemetry.send_once(mavlink.MAVLINK_MSG_ID_HOME_POSITION, link)
        return ACCEPTED

    def _set_home(self, p: Params, _link: int) -> int:
        estimate = self._ap.estimate
        if p.p[0] == 1 and estimate is not None:
            self._ap.navigator.home_enu_m = estimate.pos_enu_m.copy()
        elif p.is_place:
            self._ap.navigator.home_enu_m = self._point(p.x, p.y, p.z, relative=False)
        else:
            return DENIED
        self._telemetry.due_now(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
        return ACCEPTED

    def _capabilities(self, _p: Params, link: int) -> int:
        self._telemetry.send_once(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION, link)
        return ACCEPTED

    def _condition_yaw(self, p: Params, _link: int) -> int:
        if self._ap.mode is not Mode.GUIDED or self._ap.estimate is None:
            return FAILED
        angle = math.radians(p.p[0])
        if p.p[3]:
            angle = to_euler(self._ap.estimate.quat_wxyz)[2] + math.copysign(angle, p.p[2] or 1)
        self._ap.navigator.guided.yaw_rad = angle
        self._ap.navigator.guided.yaw_rate_rad_s = None
        return ACCEPTED

    def _source_set(self, p: Params, _link: int) -> int:
        return ACCEPTED if self._ap.aiding.sources.select(p.p[0]) else DENIED

    # ---- guided targets -----------------------------------------------------------------------------

    def _local_target(self, message: Any, _link: int) -> None:
        ap = self._ap
        if ap.mode is not Mode.GUIDED or ap.estimate is None:
            return
        frame = message.coordinate_frame
        position, velocity = (
            np.array([message.y, message.x, -message.z], np.float64),
            np.array([message.vy, message.vx, -message.vz], np.float64),
        )
        if frame in (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED):
            position, velocity = self._turned(position), self._turned(velocity)
        if frame in _FROM_VEHICLE:
            position = position + ap.estimate.pos_enu_m
        elif frame != mavlink.MAV_FRAME_LOCAL_NED:
            return
        self._set_guided(message, position, velocity)

    def _turned(self, enu: F64) -> F64:
        """Rotate a vector ahead and right of the vehicle into the map, keeping it level."""
        if self._ap.estimate is None:
            return enu
        yaw = to_euler(self._ap.estimate.quat_wxyz)[2]
        level = np.array([math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)])
        north_east_down = rotate(level, np.array([enu[1], enu[0], -enu[2]]))
        return np.array([north_east_down[1], north_east_down[0], -north_east_down[2]])

    def _global_target(self, message: Any, _link: int) -> None:
        if self._ap.mode is not Mode.GUIDED or message.coordinate_frame not in _GLOBAL:
            return
        relative = message.coordinate_frame in _RELATIVE
        place = message.lat_int * 1e-7, message.lon_int * 1e-7, message.alt
        if _uses(message, _IGNORE_POSITION):
            if not _is_place(*place):
                return
            point = self._point(*place, relative=relative)
        else:
            point = np.zeros(3)
        self._set_guided(message, point, np.array([message.vy, message.vx, -message.vz], np.float64))

    def _set_guided(self, message: Any, position: F64, velocity: F64) -> None:
        use_position = _uses(message, _IGNORE_POSITION)
        use_velocity = _uses(message, _IGNORE_VELOCITY)
        used = [v for v, use in ((position, use_position), (velocity, use_velocity)) if use]
        if not used or not np.isfinite(used).all():
            return
        use_yaw = not message.type_mask & _IGNORE_YAW and math.isfinite(message.yaw)
        use_rate = not message.type_mask & _IGNORE_YAW_RATE and math.isfinite(message.yaw_rate)
        before = None if use_rate else self._ap.navigator.guided.yaw_rad
        self._ap.navigator.guided = GuidedTarget(
            position_enu_m=position if use_position else None,
            velocity_enu_ms=velocity if use_velocity else None,
            yaw_rad=float(message.yaw) if use_yaw else before,
            yaw_rate_rad_s=float(message.yaw_rate) if use_rate else None,
            stamp_ns=self._ap.now_ns,
        )

    # ---- sensors and time ---------------------------------------------------------------------------

    def _landing_target(self, message: Any, _link: int) -> None:
        p = self._ap.parameters
        if p["PLND_ENABLED"] and p["PLND_TYPE"] == 1:
            text = self._ap.precland.receive(message, self._ap.now_ns, p)
            if text:
                self._ap.send_text(text, mavlink.MAV_SEVERITY_WARNING)

    def _distance_sensor(self, message: Any, _link: int) -> None:
        if message.orientation == self._ap.parameters["RNGFND1_ORIENT"]:
            in_range = message.min_distance <= message.current_distance <= message.max_distance
            distance_m = message.current_distance / 100 if in_range else math.inf
            self._ap.rangefinder = (self._ap.now_ns, distance_m)

    def _obstacle_distance(self, message: Any, _link: int) -> None:
        p = self._ap.parameters
        self._ap.proximity.receive(
            message, self._ap.now_ns, mirrored=p["PRX1_ORIENT"] == 1, turned_deg=p["PRX1_YAW_CORR"]
        )

    def _obstacle_distance_3d(self, message: Any, _link: int) -> None:
        self._ap.proximity.receive_3d(message, self._ap.now_ns)

    def _odometry(self, message: Any, _link: int) -> None:
        self._ap.aiding.external.on_odometry(message, self._ap.now_ns)

    def _vision_position(self, message: Any, _link: int) -> None:
        self._ap.aiding.external.on_vision_position(message, self._ap.now_ns)

    def _vision_speed(self, message: Any, _link: int) -> None:
        self._ap.aiding.external.on_vision_speed(message, self._ap.now_ns)

    def _timesync(self, message: Any, link: int) -> None:
        if message.tc1 == 0:
            answer = mavlink.MAVLink_timesync_message(self._ap.clock_ns, message.ts1)
            self._ap.send(answer, link)

    def _heartbeat(self, message: Any, _link: int) -> None:
        if message.get_srcSystem() == self._ap.parameters["SYSID_MYGCS"]:
            self._failsafes.station_heard_ns = self._ap.now_ns

    def _override(self, message: Any, _link: int) -> None:
        """Override channels, from the ground station with the system ID SYSID_MYGCS only."""
        if message.get_srcSystem() == self._ap.parameters["SYSID_MYGCS"]:
            channels = [getattr(message, f"chan{number}_raw") for number in range(1, 9)]
            self._ap.receiver.override(channels, self._ap.now_ns)

    # ---- parameters ---------------------------------------------------------------------------------

    def _param(self, name: str, link: int) -> None:
        names = sorted(self._ap.parameters)
        self._ap.send(
            mavlink.MAVLink_param_value_message(
                name.encode(),
                float(self._ap.parameters[name]),
                mavlink.MAV_PARAM_TYPE_REAL32,
                len(names),
                names.index(name),
            ),
            link,
        )

    def _param_list(self, _message: Any, link: int) -> None:
        for name in sorted(self._ap.parameters):
            self._param(name, link)

    def _param_read(self, message: Any, link: int) -> None:
        names = sorted(self._ap.parameters)
        name = message.param_id
        if message.param_index >= 0 and message.param_index < len(names):
            name = names[message.param_index]
        if name in self._ap.parameters:
            self._param(name, link)

    def _param_set(self, message: Any, link: int) -> None:
        if message.param_id in self._ap.parameters:
            if in_range(message.param_id, message.param_value):
                self._ap.parameters[message.param_id] = float(message.param_value)
            self._param(message.param_id, link)

    def _data_stream(self, message: Any, link: int) -> None:
        self._telemetry.data_stream(link, message.req_stream_id, message.req_message_rate, message.start_stop)


def _uses(message: Any, ignored: int) -> bool:
    return bool(message.type_mask & ignored != ignored)
