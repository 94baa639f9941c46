"""Obstacles around the vehicle from OBSTACLE_DISTANCE, and how far a velocity may lead towards them.

ArduPilot takes the angles relative to the body whatever the frame field says, forgets the message after half
a second, and with AVOID_ENABLE's second bit limits GUIDED velocities, never GUIDED positions.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

FRESH_NS = 500_000_000
BRAKE_MS2 = 1.0


class Proximity:
    """The latest OBSTACLE_DISTANCE."""

    def __init__(self) -> None:
        self._stamp_ns: int | None = None
        self._seen: list[tuple[float, float]] = []

    def receive(self, message: Any, now_ns: int) -> None:
        """Take an OBSTACLE_DISTANCE; 0, 65535 and what is out of its own range mean nothing there."""
        step_deg = message.increment_f if message.increment_f > 0 else float(message.increment)
        first_deg = message.angle_offset
        if not (math.isfinite(step_deg) and math.isfinite(first_deg)):
            return
        low, high = max(1, message.min_distance), min(65_534, message.max_distance)
        self._stamp_ns = now_ns
        seen = [
            (math.radians(first_deg + i * step_deg), distance / 100)
            for i, distance in enumerate(message.distances)
            if low <= distance <= high
        ]
        # Nearest first: what is left of a velocity after the face of a wall slides along it.
        self._seen = sorted(seen, key=lambda one: one[1])

    def fresh(self, now_ns: int) -> bool:
        """Tell whether a message came in the last half second."""
        return self._stamp_ns is not None and now_ns - self._stamp_ns <= FRESH_NS

    def limited(self, velocity_enu_ms: F64, yaw_rad: float, margin_m: float, now_ns: int) -> F64:
        """Return a velocity (3,) whose part towards each obstacle lets it stop `margin_m` before it."""
        if not self.fresh(now_ns):
            return velocity_enu_ms
        east, north = float(velocity_enu_ms[0]), float(velocity_enu_ms[1])
        for angle, distance in self._seen:
            to_east, to_north = math.sin(yaw_rad + angle), math.cos(yaw_rad + angle)
            excess = east * to_east + north * to_north - _fastest(distance - margin_m)
            if excess > 0:
                east, north = east - excess * to_east, north - excess * to_north
        return np.array([east, north, float(velocity_enu_ms[2])])


def _fastest(room_m: float) -> float:
    """Return the speed from which it stops within this room, with a second to react."""
    if room_m <= 0:
        return 0.0
    return math.sqrt(BRAKE_MS2**2 + 2 * BRAKE_MS2 * room_m) - BRAKE_MS2
