"""Proximity sensing from MAVLink obstacle messages, and the velocity limit before obstacles.

As measured on ArduPilot: angles of OBSTACLE_DISTANCE are relative to the body whatever its frame field says.
OBSTACLE_DISTANCE_3D is accepted in BODY_FRD only, yet one in another frame counts as a sign of life. Half a
second without either means no data. AVOID_ENABLE's second bit limits GUIDED velocities, never positions.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Ray = tuple[float, float, float, float]

FRESH_NS = 500_000_000
FACE_NS = 1_000_000_000
BATCH_NS = 50_000_000
BODY_FRD = 12
BRAKE_MS2 = 1.0


class Proximity:
    """Latest OBSTACLE_DISTANCE, and latest complete batch of OBSTACLE_DISTANCE_3D.

    Obstacles are stored as distances and unit vectors forward, right, down, level but rotated with the
    heading. An obstacle without an update is dropped after a second, all of them after half a second of
    silence.
    """

    def __init__(self) -> None:
        self._heard_ns: int | None = None
        self._around: tuple[int, list[Ray]] = (0, [])
        self._points: tuple[int, list[Ray]] = (0, [])
        self._batch: tuple[int, list[Ray]] = (0, [])
        self._batch_stamp: int | None = None

    def receive(self, message: Any, now_ns: int, *, mirrored: bool = False, turned_deg: float = 0.0) -> None:
        """Process an OBSTACLE_DISTANCE; 0, 65535 and values out of its own range mean no obstacle.

        mirrored, turned_deg: PRX1_ORIENT and PRX1_YAW_CORR.
        """
        step_deg = message.increment_f if message.increment_f > 0 else float(message.increment)
        first_deg = message.angle_offset + turned_deg
        step_deg = -step_deg if mirrored else step_deg
        if not (math.isfinite(step_deg) and math.isfinite(first_deg)):
            return
        low, high = max(1, message.min_distance), min(65_534, message.max_distance)
        self._heard_ns = now_ns
        seen = [
            (distance / 100, *_level(math.radians(first_deg + i * step_deg)))
            for i, distance in enumerate(message.distances)
            if low <= distance <= high
        ]
        self._around = now_ns, seen

    def receive_3d(self, message: Any, now_ns: int) -> None:
        """Process an OBSTACLE_DISTANCE_3D; a batch of one stamp is used at the next stamp or after 50 ms.

        Points at distance zero or out of the message's own range are dropped silently.
        """
        self._heard_ns = now_ns
        if message.frame != BODY_FRD:
            return
        if message.time_boot_ms != self._batch_stamp or now_ns - self._batch[0] > BATCH_NS:
            self._points, self._batch = self._batch, (now_ns, [])
        self._batch_stamp = message.time_boot_ms
        distance = math.hypot(message.x, message.y, message.z)
        points = self._batch[1]
        if distance > 0 and message.min_distance <= distance <= message.max_distance:
            points.append((distance, message.x / distance, message.y / distance, message.z / distance))
        self._batch = now_ns, points

    def fresh(self, now_ns: int) -> bool:
        """Return whether a message came in the last half second."""
        return self._heard_ns is not None and now_ns - self._heard_ns <= FRESH_NS

    def limited(self, velocity_enu_ms: F64, yaw_rad: float, margin_m: float, now_ns: int) -> F64:
        """Return a velocity (3,) whose part towards each obstacle lets it stop `margin_m` before it."""
        sine, cosine = math.sin(yaw_rad), math.cos(yaw_rad)
        east, north, up = (float(v) for v in velocity_enu_ms)
        for distance, forward, right, down in self._rays(now_ns):
            to_east, to_north = forward * sine + right * cosine, forward * cosine - right * sine
            excess = east * to_east + north * to_north - up * down - _fastest(distance - margin_m)
            if excess > 0:
                east, north, up = east - excess * to_east, north - excess * to_north, up + excess * down
        return np.array([east, north, up])

    def _rays(self, now_ns: int) -> list[Ray]:
        """Return the current obstacles, nearest first, so that a limited velocity slides along a wall."""
        if not self.fresh(now_ns):
            return []
        done = self._batch if now_ns - self._batch[0] > BATCH_NS else self._points
        rays = [ray for at, seen in (self._around, done) if now_ns - at <= FACE_NS for ray in seen]
        return sorted(rays)


def _level(angle_rad: float) -> tuple[float, float, float]:
    return math.cos(angle_rad), math.sin(angle_rad), 0.0


def _fastest(room_m: float) -> float:
    """Return the speed that allows a stop within a distance, with a second to react."""
    if room_m <= 0:
        return 0.0
    return math.sqrt(BRAKE_MS2**2 + 2 * BRAKE_MS2 * room_m) - BRAKE_MS2
