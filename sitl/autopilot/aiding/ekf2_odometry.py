"""External navigation as PX4 takes it: ODOMETRY in four frames, and VISION_POSITION_ESTIMATE.

The pose may be in MAV_FRAME_LOCAL_NED, _ENU, _FRD or _FLU, the velocity in the body (FRD); any other frame is
not a number to EKF2. Quality is judged by the filter (EKF2_EV_QMIN). EKF2_EV_CTRL counts at once.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.aiding.external_navigation import ExternalPose
from sitl.autopilot.aiding.source_sets import JitterCorrection
from sitl.vehicle.rigid_body import ned, rotate, to_euler

F64 = NDArray[np.float64]

DEFAULTS: dict[str, float] = {
    "EKF2_EN": 0,
    "EKF2_EV_CTRL": 0,  # bits: 1 horizontal position, 2 height (not modelled), 4 velocity, 8 heading
    "EKF2_EV_DELAY": 0,  # ms
    "EKF2_EV_QMIN": 0,
    "EKF2_EVP_NOISE": 0.1,  # m
    "EKF2_EVV_NOISE": 0.1,  # m/s
    "EKF2_EVA_NOISE": 0.1,  # rad
    "EKF2_NOAID_TOUT": 5.0,  # s; PX4 counts microseconds
    "EKF2_REQ_GPS_H": 10.0,  # s
}
NED_FRAMES = (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_ENU)
TURNED_FRAMES = (mavlink.MAV_FRAME_LOCAL_FRD, mavlink.MAV_FRAME_LOCAL_FLU)
SPEED_FRAMES = (
    mavlink.MAV_FRAME_BODY_FRD,
    mavlink.MAV_FRAME_BODY_NED,
    mavlink.MAV_FRAME_BODY_OFFSET_NED,
)


class Ekf2Odometry:
    """Receiver of external poses for EKF2, with the interface of `ExternalNavigation`.

    Attributes
    ----------
    refused
        Number of messages in a frame that is not taken.
    is_turned
        Whether the latest pose is in a frame whose heading is its own (FRD, FLU).
    quality
        Of the latest pose.
    """

    def __init__(self, parameters: dict[str, float]) -> None:
        self._parameters = parameters
        self.refused = self.quality = 0
        self.is_turned = False
        self.restart()

    def restart(self) -> None:
        """Start anew."""
        self._resets = 0
        self._jitter = JitterCorrection()
        self._poses: list[ExternalPose] = []

    @property
    def enabled(self) -> bool:
        """True if anything of external poses is used."""
        return int(self._parameters["EKF2_EV_CTRL"]) != 0

    def is_healthy(self, now_ns: int) -> bool:
        """Return True: PX4 arms without external poses."""
        return True

    def on_odometry(self, message: Any, now_ns: int) -> None:
        """Process an ODOMETRY."""
        frame = message.frame_id
        position = _enu(frame, message.x, message.y, message.z)
        if position is None:
            self.refused += 1
            return
        attitude = np.array(message.q, np.float64)
        known = bool(np.isfinite(attitude).all()) and bool(attitude.any())
        velocity = np.array([message.vx, message.vy, message.vz], np.float64)
        moving = known and message.child_frame_id in SPEED_FRAMES and bool(np.isfinite(velocity).all())
        self.is_turned, self.quality = frame in TURNED_FRAMES, int(message.quality)
        self._add(
            message,
            int(message.time_usec),
            message.pose_covariance,
            now_ns,
            position,
            ned(rotate(attitude, velocity)) if moving else None,
            to_euler(attitude)[2] if known else None,
            max(float(message.velocity_covariance[0]), float(message.velocity_covariance[6])),
        )

    def on_vision_speed(self, message: Any, now_ns: int) -> None:
        """Ignore a VISION_SPEED_ESTIMATE, which PX4 does not know."""

    def on_vision_position(self, message: Any, now_ns: int) -> None:
        """Process a VISION_POSITION_ESTIMATE, north-east-down."""
        position = np.array([message.y, message.x, -message.z], np.float64)
        yaw = float(message.yaw) if math.isfinite(message.yaw) else None
        self.is_turned, self.quality = False, 0
        self._add(message, int(message.usec), message.covariance, now_ns, position, None, yaw)

    def drain(self, filter_enu_m: F64 | None) -> list[ExternalPose]:
        """Return the poses since the last call; PX4 aligns nothing beforehand."""
        poses, self._poses = self._poses, []
        return poses

    def _add(
        self,
        message: Any,
        stamp_us: int,
        covariance: Any,
        now_ns: int,
        position_enu_m: F64,
        velocity_enu_ms: F64 | None,
        yaw_rad: float | None,
        velocity_variance_m2s2: float = 0.0,
    ) -> None:
        p = self._parameters
        if not self.enabled or not np.isfinite(position_enu_m).all():
            return
        stamp_ns = self._jitter.local_ns(stamp_us * 1000, now_ns)
        variance = max(float(covariance[0]), float(covariance[6]))
        angle = float(covariance[20])
        is_reset = message.reset_counter != self._resets
        self._resets = message.reset_counter
        self._poses.append(
            ExternalPose(
                stamp_ns - round(p["EKF2_EV_DELAY"] * 1e6),
                position_enu_m,
                velocity_enu_ms,
                yaw_rad,
                max(p["EKF2_EVP_NOISE"], math.sqrt(variance) if variance > 0 else 0.0),
                max(p["EKF2_EVV_NOISE"], math.sqrt(max(0.0, velocity_variance_m2s2))),
                max(p["EKF2_EVA_NOISE"], math.sqrt(angle) if angle > 0 else 0.0),
                is_reset,
            )
        )


def _enu(frame: int, x: float, y: float, z: float) -> F64 | None:
    """Return a position ENU, None in a frame that PX4 does not know."""
    match frame:
        case mavlink.MAV_FRAME_LOCAL_NED | mavlink.MAV_FRAME_LOCAL_FRD:
            return np.array([y, x, -z], np.float64)
        case mavlink.MAV_FRAME_LOCAL_ENU:
            return np.array([x, y, z], np.float64)
        case mavlink.MAV_FRAME_LOCAL_FLU:
            return np.array([-y, x, z], np.float64)
    return None
