"""External poses as a companion sends them, for tests of their use."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

F64 = NDArray[np.float64]
LOCAL_FRD, BODY_FRD = mavlink.MAV_FRAME_LOCAL_FRD, mavlink.MAV_FRAME_BODY_FRD
EXTERNAL = {
    "VISO_TYPE": 1.0,
    "EK3_SRC2_POSXY": 6.0,
    "EK3_SRC2_VELXY": 6.0,
    "EK3_SRC2_YAW": 6.0,
}
UNKNOWN = [math.nan] + [0.0] * 20


def odometry(
    position_enu_m: F64,
    stamp_us: int,
    *,
    yaw_rad: float = 0.0,
    frames: tuple[int, int] = (LOCAL_FRD, BODY_FRD),
    quality: int = 90,
    resets: int = 0,
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Any:
    """Return an ODOMETRY; velocity is forward, right, down."""
    east, north, up = (float(v) for v in position_enu_m)
    quat = [math.cos(yaw_rad / 2), 0.0, 0.0, math.sin(yaw_rad / 2)]
    return mavlink.MAVLink_odometry_message(
        stamp_us, *frames, north, east, -up, quat, *velocity, 0.0, 0.0, 0.0, UNKNOWN, UNKNOWN, resets,
        mavlink.MAV_ESTIMATOR_TYPE_LIDAR, quality,
    )  # fmt: skip
