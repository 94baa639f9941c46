"""DISTANCE_SENSOR: height above the ground below the vehicle, from the returns there.

ArduPilot (RNGFND1_TYPE = 10) slows its landing by this height; without a rangefinder it uses the height above
home, and reaches a roof at full sink rate.
"""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

LONGEST_M = 120.0
LEAST_DOWN = 0.707


def downward_distance(height_m: float, boot_ms: int, down: float = 1.0) -> Any | None:
    """Return the message for a height above ground (m), None if it is unknown or out of range.

    Parameters
    ----------
    down
        Cosine of the vehicle's tilt. A rangefinder measures along the vehicle's own axis, and both autopilots
        multiply by this cosine; ArduPilot by no less than `LEAST_DOWN`, below which PX4 rejects the message.
    """
    height_m = height_m / max(LEAST_DOWN, down)
    if not math.isfinite(height_m) or not 0.0 <= height_m <= LONGEST_M:
        return None
    return mavlink.MAVLink_distance_sensor_message(
        boot_ms % 2**32,
        5,
        round(LONGEST_M * 100),
        round(height_m * 100),
        mavlink.MAV_DISTANCE_SENSOR_LASER,
        0,
        mavlink.MAV_SENSOR_ROTATION_PITCH_270,
        255,
    )
