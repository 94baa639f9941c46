"""Velocity guidance to a position."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

BRAKING_MS2 = 1.2
GAIN_PER_S = 0.8
LEAD_S = 0.7  # in which an autopilot's velocity follows its setpoint, with the delays of the link


def towards(
    offset_m: NDArray[np.float64], speed_ms: float, velocity_enu_ms: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the horizontal velocity (2,) that covers an offset (2,) without overshoot, at the present one.

    The speed is `speed_ms` far away, follows a constant deceleration nearer, and is proportional to the
    distance at the end. Distances are those of the moment when the vehicle obeys.
    """
    left_m = offset_m - LEAD_S * velocity_enu_ms[:2]
    distance = float(np.hypot(*left_m))
    if distance < 1e-6:
        return np.zeros(2)
    speed = min(speed_ms, GAIN_PER_S * distance, math.sqrt(2 * BRAKING_MS2 * distance))
    return np.asarray(left_m * (speed / distance))


def level(error_m: float, speed_ms: float) -> float:
    """Return the vertical velocity, up positive, that removes a height error."""
    return max(-speed_ms, min(speed_ms, GAIN_PER_S * error_m))


def course_rad(velocity_enu_ms: NDArray[np.float64]) -> float:
    """Return the course of a velocity, rad clockwise from north."""
    return math.atan2(float(velocity_enu_ms[0]), float(velocity_enu_ms[1]))
