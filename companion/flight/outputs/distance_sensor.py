"""DISTANCE_SENSOR: the height above the ground under the vehicle, from the returns below it.

ArduPilot (RNGFND1_TYPE = 10) slows its landing by it; without a rangefinder it trusts the height above home,
and reaches a roof at full sink rate.
"""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

LONGEST_M = 120.0
LEAST_DOWN = 0.707


def downward_distance(height_m: float, boot_ms: int, down: float = 1.0) -> Any | None:
    """Return the message for a height above ground (m), None if that is unknown or out of range.

    Parameters
    ----------
    down
        Cosine of the vehicle's tilt. A rangefinder measures along the vehicle's own axis, and both autopilots
        multiply by this to have the height; ArduPilot by no less than `LEAST_DOWN`, and PX4 takes none then.
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
