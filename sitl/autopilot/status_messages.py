"""Status messages: HEARTBEAT, SYS_STATUS, battery, GPS, EKF, wind, radio control and fence."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.aiding.ekf2_aiding import INVALID
from sitl.autopilot.autopilot_view import AutopilotView
from sitl.autopilot.failsafe import Failsafes
from sitl.autopilot.modes import NEEDS_POSITION, Mode
from sitl.autopilot.position_aiding import TEST_RATIO, UNAIDED

_OTHERS: int = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_SENSOR_Z_ALTITUDE_CONTROL
    | mavlink.MAV_SYS_STATUS_AHRS
)
UNKNOWN_RSSI, SATELLITES, SATELLITES_WITHOUT_FIX = 255, 17, 3


class StatusMessages:
    """Factories of the current status messages; None if ArduCopter sends none."""

    def __init__(self, autopilot: AutopilotView, failsafes: Failsafes) -> None:
        self._ap, self._failsafes = autopilot, failsafes
        self._fixed = (0, 0, 0)
        self.makers: dict[int, Callable[[], Any]] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self._heartbeat,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: self._battery,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps_raw,
            mavlink.MAVLINK_MSG_ID_GPS2_RAW: self._second_gps,
            mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: self._ekf_status,
            mavlink.MAVLINK_MSG_ID_WIND: autopilot.wind.message,
            mavlink.MAVLINK_MSG_ID_RC_CHANNELS: self._rc_channels,
            mavlink.MAVLINK_MSG_ID_FENCE_STATUS: self._fence_status,
        }
        if autopilot.has_ekf2:
            del self.makers[mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT]
            self.makers[mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS] = self._estimator_status

    def _heartbeat(self) -> Any:
        ap = self._ap
        flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        flags |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if ap.armed else 0
        if ap.mode in NEEDS_POSITION or ap.mode is Mode.LAND:
            flags |= mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
            flags |= 0 if ap.navigator.blind else mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
        return mavlink.MAVLink_heartbeat_message(
            ap.airframe.kind.value,
            mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
            flags,
            int(ap.mode),
            self._state(),
            3,
        )

    def _state(self) -> int:
        """Return MAV_STATE: critical for any failsafe except the fence, standby on the ground."""
        if self._failsafes.any_triggered:
            return int(mavlink.MAV_STATE_CRITICAL)
        return int(mavlink.MAV_STATE_ACTIVE if self._ap.airborne else mavlink.MAV_STATE_STANDBY)

    def _sys_status(self) -> Any:
        """Return SYS_STATUS with the bits of present, enabled and healthy sensors.

        ArduCopter's GPS bit stays healthy without a fix; in a landing without position the position control
        is off. A disabled fence is present and healthy, not enabled.
        """
        ap, safe = self._ap, self._failsafes
        # bit, enabled, healthy
        rows = (
            (mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER, True, not safe.radio),
            (mavlink.MAV_SYS_STATUS_SENSOR_BATTERY, True, not safe.battery),
            (mavlink.MAV_SYS_STATUS_GEOFENCE, safe.fence.enabled, not safe.fence.breached),
            (mavlink.MAV_SYS_STATUS_PREARM_CHECK, True, ap.position_ok),
            (
                mavlink.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL,
                not ap.navigator.blind,
                not ap.navigator.blind,
            ),
        )
        present = _OTHERS | sum(bit for bit, _, _ in rows)
        enabled = _OTHERS | sum(bit for bit, on, _ in rows if on)
        health = _OTHERS | sum(bit for bit, _, healthy in rows if healthy)
        return mavlink.MAVLink_sys_status_message(
            present, enabled, health, 200, self._volts_mv(), 1200, round(ap.battery_pct), 0, 0, 0, 0, 0, 0
        )

    def _volts_mv(self) -> int:
        return round(self._ap.battery_v * 1000)

    def _battery(self) -> Any:
        ap = self._ap
        return mavlink.MAVLink_battery_status_message(
            0, 0, 3, 2500, [self._volts_mv()] + [65535] * 9, 1200, round(ap.battery_used_mah), -1,
            round(ap.battery_pct),
        )  # fmt: skip

    def _gps_raw(self) -> Any:
        """Return GPS_RAW_INT: of the first receiver."""
        dead = self._ap.aiding.gnss.first_is_dead
        fix = mavlink.GPS_FIX_TYPE_NO_GPS if dead else self._ap.aiding.fix_type
        return mavlink.MAVLink_gps_raw_int_message(*self._measured(fix))

    def _second_gps(self) -> Any:
        """Return GPS2_RAW, None without a second receiver."""
        if not self._ap.parameters["GPS2_TYPE"]:
            return None
        return mavlink.MAVLink_gps2_raw_message(*self._measured(self._ap.aiding.fix_type), 0, 0)

    def _measured(self, fix: int) -> tuple[int, ...]:
        """Return what both messages say from time to satellites; without a fix the last position."""
        ap, estimate = self._ap, self._ap.estimate
        if estimate is None or fix < mavlink.GPS_FIX_TYPE_3D_FIX:
            return (ap.estimate_boot_ns // 1000, fix, *self._fixed, 70, 110, 0, 0, SATELLITES_WITHOUT_FIX)
        lat, lon, alt = ap.lla(ap.aiding.gps_position(estimate))
        self._fixed = round(lat * 1e7), round(lon * 1e7), round(alt * 1000)
        east, north = (float(v) for v in estimate.vel_enu_ms[:2])
        course = round(math.degrees(math.atan2(east, north)) * 100) % 36000
        fix = fix if ap.settled else mavlink.GPS_FIX_TYPE_2D_FIX
        speed = round(math.hypot(east, north) * 100)
        return (ap.estimate_boot_ns // 1000, fix, *self._fixed, 70, 110, speed, course, SATELLITES)

    def _ekf_status(self) -> Any:
        aiding = self._ap.aiding
        flags = aiding.flags if self._ap.settled else UNAIDED
        return mavlink.MAVLink_ekf_status_report_message(
            flags, aiding.test_ratio, aiding.position_test_ratio, TEST_RATIO, TEST_RATIO, 0.0
        )

    def _estimator_status(self) -> Any:
        aiding, boot_us = self._ap.aiding, self._ap.estimate_boot_ns // 1000
        flags = aiding.flags if self._ap.settled else INVALID
        ratio = aiding.position_test_ratio
        others = (TEST_RATIO,) * 4
        return mavlink.MAVLink_estimator_status_message(boot_us, flags, TEST_RATIO, ratio, *others, 0.5, 0.5)

    def _rc_channels(self) -> Any:
        ap = self._ap
        channels = ap.receiver.channels(ap.now_ns)
        boot_ms = ap.boot_ns // 1_000_000
        unused = [0] * (18 - len(channels))
        return mavlink.MAVLink_rc_channels_message(boot_ms, len(channels), *channels, *unused, UNKNOWN_RSSI)

    def _fence_status(self) -> Any:
        fence = self._failsafes.fence
        return fence.status() if fence.enabled else None
