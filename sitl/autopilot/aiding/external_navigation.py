"""External navigation: ODOMETRY and VISION_POSITION_ESTIMATE, as ArduPilot takes them (AP_VisualOdom_MAV).

Taken is ODOMETRY in MAV_FRAME_LOCAL_FRD with child frame MAV_FRAME_BODY_FRD only; any other frame is dropped
without a word. LOCAL_FRD is read as north-east-down about the filter's origin. A quality below VISO_QUAL_MIN
and a position that is not a number reach the filter never, and more than one pose in 20 ms neither. While the
filter takes its position from elsewhere, and any source set names external navigation, each pose is aligned
to the filter's position (ArduPilot from 4.8; before, only its own cameras were): a switch is then no jump.
VISO_TYPE is read at the start; VISO_POS, VISO_ORIENT and VISO_SCALE are not modelled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.aiding.source_sets import JitterCorrection
from sitl.vehicle.rigid_body import ned, rotate, to_euler

F64 = NDArray[np.float64]

DEFAULTS: dict[str, float] = {
    "VISO_TYPE": 0,  # 0 none, 1 MAVLink
    "VISO_DELAY_MS": 10,
    "VISO_POS_M_NSE": 0.2,  # m
    "VISO_VEL_M_NSE": 0.1,  # m/s
    "VISO_YAW_M_NSE": 0.2,  # rad
    "VISO_QUAL_MIN": 0,
}
LIMITS: dict[str, tuple[float, float]] = {
    "VISO_TYPE": (0, 3),
    "VISO_DELAY_MS": (0, 250),
    "VISO_POS_M_NSE": (0.1, 10),
    "VISO_VEL_M_NSE": (0.05, 5),
    "VISO_YAW_M_NSE": (0.05, 1),
    "VISO_QUAL_MIN": (-1, 100),
}
FROM_MAVLINK = 1
HEALTHY_NS = 300_000_000
LEAST_INTERVAL_NS = 20_000_000
LEAST_YAW_ERROR_RAD = math.radians(5.0)
_FRAMES = (mavlink.MAV_FRAME_LOCAL_FRD, mavlink.MAV_FRAME_BODY_FRD)


@dataclass(frozen=True, slots=True)
class ExternalPose:
    """Pose from outside.

    stamp_ns: simulated time that the filter takes as its own. position_enu_m: (3,). velocity_enu_ms: (3,) or
    None. yaw_rad: None if unknown. error_m, velocity_error_ms, yaw_error_rad: standard deviations. is_reset:
    the sender's frame has jumped.
    """

    stamp_ns: int
    position_enu_m: F64
    velocity_enu_ms: F64 | None
    yaw_rad: float | None
    error_m: float
    velocity_error_ms: float
    yaw_error_rad: float
    is_reset: bool


class ExternalNavigation:
    """Receiver of external poses; `drain` hands them to the filter.

    Attributes
    ----------
    refused
        Number of messages in a frame that is not taken.
    """

    def __init__(self, parameters: dict[str, float]) -> None:
        self._parameters = parameters
        self.refused = 0
        self.restart()

    def restart(self) -> None:
        """Start anew: VISO_TYPE is read, and the alignment to the filter is lost."""
        self._enabled = int(self._parameters["VISO_TYPE"]) == FROM_MAVLINK
        self._alignment_enu_m: F64 = np.zeros(3)
        self._heard_ns: int | None = None
        self._written_ns: int | None = None
        self._resets = 0
        self._jitter = JitterCorrection()
        self._poses: list[ExternalPose] = []

    @property
    def enabled(self) -> bool:
        """True if VISO_TYPE was MAVLink at the start."""
        return self._enabled

    def is_healthy(self, now_ns: int) -> bool:
        """Return whether a message arrived within the last 0.3 s, whatever its quality."""
        return self._heard_ns is not None and now_ns - self._heard_ns < HEALTHY_NS

    def on_odometry(self, message: Any, now_ns: int) -> None:
        """Process an ODOMETRY."""
        if (message.frame_id, message.child_frame_id) != _FRAMES:
            self.refused += 1
            return
        attitude = np.array(message.q, np.float64)
        known = bool(np.isfinite(attitude).all()) and bool(attitude.any())
        velocity = np.array([message.vx, message.vy, message.vz], np.float64)
        moving = known and bool(np.isfinite(velocity).all())
        self._add(
            message,
            message.time_usec,
            message.pose_covariance,
            now_ns,
            velocity_enu_ms=ned(rotate(attitude, velocity)) if moving else None,
            yaw_rad=to_euler(attitude)[2] if known else None,
            quality=int(message.quality),
        )

    def on_vision_position(self, message: Any, now_ns: int) -> None:
        """Process a VISION_POSITION_ESTIMATE, which has no frame and no quality."""
        yaw = float(message.yaw) if math.isfinite(message.yaw) else None
        self._add(message, message.usec, message.covariance, now_ns, None, yaw, quality=0)

    def on_vision_speed(self, message: Any, now_ns: int) -> None:
        """Process a VISION_SPEED_ESTIMATE: its stamp shows the sender's clock, and it is a sign of life.

        Its velocity is not modelled.
        """
        if self._enabled:
            self._jitter.local_ns(int(message.usec) * 1000, now_ns)
            self._heard_ns = now_ns

    def drain(self, filter_enu_m: F64 | None) -> list[ExternalPose]:
        """Return the poses since the last call, aligned to the filter's position if one is given."""
        poses, self._poses = self._poses, []
        if filter_enu_m is not None and poses:
            shift = filter_enu_m - poses[-1].position_enu_m
            self._alignment_enu_m = self._alignment_enu_m + shift * np.array([1.0, 1.0, 0.0])
        return poses

    def _add(
        self,
        message: Any,
        stamp_us: int,
        covariance: Any,
        now_ns: int,
        velocity_enu_ms: F64 | None,
        yaw_rad: float | None,
        quality: int,
    ) -> None:
        if not self._enabled:
            return
        p = self._parameters
        stamp_ns = self._jitter.local_ns(int(stamp_us) * 1000, now_ns)
        self._heard_ns = now_ns
        position = np.array([message.y, message.x, -message.z], np.float64)
        error_m, yaw_error_rad = _errors(covariance)
        soon = self._written_ns is not None and stamp_ns - self._written_ns < LEAST_INTERVAL_NS
        if quality < p["VISO_QUAL_MIN"] or soon or not np.isfinite([*position, error_m]).all():
            return
        self._written_ns = stamp_ns
        is_reset = message.reset_counter != self._resets
        self._resets = message.reset_counter
        self._poses.append(
            ExternalPose(
                stamp_ns - round(p["VISO_DELAY_MS"] * 1e6),
                position + self._alignment_enu_m,
                velocity_enu_ms,
                yaw_rad,
                min(100.0, max(p["VISO_POS_M_NSE"], error_m)),
                p["VISO_VEL_M_NSE"],
                max(p["VISO_YAW_M_NSE"], LEAST_YAW_ERROR_RAD, min(1.5, yaw_error_rad)),
                is_reset,
            )
        )


def _errors(covariance: Any) -> tuple[float, float]:
    """Return the standard deviations of position (m) and attitude (rad): roots of the summed variances."""
    c = [float(value) for value in covariance]
    if math.isnan(c[0]):
        return 0.0, 0.0
    attitude = c[15] + c[18] + c[20]
    position = c[0] + c[6] + c[11]
    yaw_error = math.sqrt(attitude) if attitude >= 0 else 0.0
    return math.sqrt(position) if position >= 0 else math.nan, yaw_error
