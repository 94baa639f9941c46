"""Conversion of MAVLink range messages from the autopilot's sensors to LiDAR returns.

DISTANCE_SENSOR gives one range in one of MAVLink's named directions; OBSTACLE_DISTANCE up to 72 around the
vehicle, in its own plane or a level one. Even these few ranges show height and walls.
"""

from __future__ import annotations

from collections import deque
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.geometry.axes import heading_rad, rotation_enu_from_frd
from companion.flight.geometry.sensor_mount import Mount
from companion.flight.link.clock.autopilot_clock import AutopilotClock
from companion.flight.link.vehicle_state import Quaternion, unit_quaternion
from companion.flight.sensors.packet_stream import OnReturns
from companion.flight.sensors.returns import Returns
from params import Parameters

Floats = NDArray[np.float64]

UNKNOWN = 65535
INVALID = (
    1  # DISTANCE_SENSOR.signal_quality: the measurement is worthless; 0 is unknown, 100 a perfect signal
)
AROUND = 8  # orientations 0 to 7 turn clockwise in steps of 45 degrees
UP, DOWN = mavlink.MAV_SENSOR_ROTATION_PITCH_90, mavlink.MAV_SENSOR_ROTATION_PITCH_270
NORTH_FRAMES = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_LOCAL_NED)
LEVEL_FRAMES = (*NORTH_FRAMES, mavlink.MAV_FRAME_LOCAL_FRD)
ATTITUDES = 64
NEAR_MS = 50  # of the attitude used to rotate the ranges
MESSAGES = ("DISTANCE_SENSOR", "OBSTACLE_DISTANCE")


@dataclass(slots=True)
class RangeCounters:
    """Counters of received and dropped data."""

    packets: int = 0
    returns: int = 0
    no_return: int = 0
    malformed: int = 0
    without_time: int = 0
    without_attitude: int = 0


class MavlinkRanges:
    """Converter of range messages to returns.

    Parameters
    ----------
    parameters
        Source of the mount, which is undone: these ranges are measured from the vehicle itself.
    clock
        The autopilot's clock.
    on_returns
        Called with the returns of each message.
    """

    def __init__(self, parameters: Parameters, clock: AutopilotClock, on_returns: OnReturns) -> None:
        self._mount = Mount(parameters)
        self._clock = clock
        self._on_returns = on_returns
        self._attitudes: deque[tuple[int, Quaternion]] = deque(maxlen=ATTITUDES)
        self.counters = RangeCounters()
        self.last_arrival_ns: int | None = None

    def on_message(self, message: Any, now_ns: int) -> None:
        """Process a message of the autopilot; messages without ranges or attitude are ignored."""
        kind = message.get_type()
        if kind == "ATTITUDE_QUATERNION":
            attitude = unit_quaternion(message.q1, message.q2, message.q3, message.q4)
            if attitude is not None:
                self._attitudes.append((message.time_boot_ms, attitude))
        if kind not in MESSAGES:
            return
        self.counters.packets += 1
        points = _beam(message) if kind == "DISTANCE_SENSOR" else _ring(message)
        if points is None:
            self.counters.malformed += 1
            return
        if not len(points):
            self.counters.no_return += 1
            return
        boot_ms = message.time_boot_ms if kind == "DISTANCE_SENSOR" else message.time_usec // 1000
        if kind == "OBSTACLE_DISTANCE" and message.frame in LEVEL_FRAMES:
            attitude = self._attitude_at(boot_ms)
            if attitude is None:
                self.counters.without_attitude += 1
                return
            points = _from_level(points, attitude, message.frame in NORTH_FRAMES)
        stamp_ns = self._clock.look_up_ns(boot_ms, now_ns)
        if stamp_ns is None:
            self.counters.without_time += 1
            return
        self.last_arrival_ns = now_ns
        self.counters.returns += len(points)
        sensor = (points - self._mount.lever_frd_m) @ self._mount.rotation_frd_from_sensor
        self._on_returns(
            Returns.plain(np.ascontiguousarray(sensor, np.float32), np.full(len(points), stamp_ns, np.int64))
        )

    def statistics(self) -> dict[str, int | float | None]:
        """Return the counters."""
        return asdict(self.counters) | {"last_arrival_ns": self.last_arrival_ns}

    def _attitude_at(self, boot_ms: int) -> Quaternion | None:
        """Return the attitude nearest to an autopilot's time, None if none is within `NEAR_MS`."""
        near = [(abs(at_ms - boot_ms), attitude) for at_ms, attitude in self._attitudes]
        away_ms, attitude = min(near, default=(NEAR_MS + 1, None))
        return attitude if away_ms <= NEAR_MS else None


def _beam(message: Any) -> Floats | None:
    """Return the point (1, 3) or none (0, 3), body forward-right-down; None for an unknown direction."""
    direction = _direction(message)
    if direction is None:
        return None
    cm = message.current_distance
    valid = getattr(message, "signal_quality", 0) != INVALID
    seen = valid and message.min_distance < cm < message.max_distance
    return (cm / 100 * direction)[None] if seen else np.empty((0, 3))


def _direction(message: Any) -> Floats | None:
    orientation = message.orientation
    if orientation < AROUND:
        turn = np.radians(45.0 * orientation)
        return np.array([np.cos(turn), np.sin(turn), 0.0])
    return {UP: np.array([0.0, 0.0, -1.0]), DOWN: np.array([0.0, 0.0, 1.0])}.get(orientation)


def _ring(message: Any) -> Floats | None:
    """Return the points (n, 3) in the message's frame, third axis down; None for an unknown frame."""
    step_deg = message.increment_f or float(message.increment)
    known = message.frame in (mavlink.MAV_FRAME_BODY_FRD, *LEVEL_FRAMES)
    if not known or not np.isfinite([step_deg, message.angle_offset]).all() or step_deg == 0:
        return None
    cm = np.array(message.distances, np.float64)
    seen = (cm > message.min_distance) & (cm < message.max_distance) & (cm != UNKNOWN)
    turn = np.radians(message.angle_offset + step_deg * np.arange(len(cm)))[seen]
    distance_m = cm[seen] / 100
    return np.column_stack([distance_m * np.cos(turn), distance_m * np.sin(turn), np.zeros(len(turn))])


def _from_level(points: Floats, attitude: Quaternion, from_north: bool) -> Floats:
    """Return level points, ahead along the vehicle's heading or north, as body forward-right-down."""
    rotation = rotation_enu_from_frd(attitude)
    heading = 0.0 if from_north else heading_rad(rotation)
    sine, cosine = np.sin(heading), np.cos(heading)
    enu_from_level = np.array([[sine, cosine, 0.0], [cosine, -sine, 0.0], [0.0, 0.0, -1.0]])
    return np.asarray(points @ enu_from_level.T @ rotation)
