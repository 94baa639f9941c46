"""LANDING_TARGET in the frame that each autopilot accepts.

ArduPilot accepts body forward-right-down with a positive distance, PX4 its own local north-east-down; each
rejects the other's frame. The stamp is always the companion's time, as in the answers to TIMESYNC: PX4 adds
the offset itself, and would take its own boot time for a future that never expires.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.fusion.odometry.correction import Correction
from companion.flight.geometry.axes import Floats, PoseLike, body_frd_m
from companion.flight.link.clock.message_order import boot_step_ms
from companion.flight.link.vehicle_state import VehicleState
from slz.frame import LocalFrame

# ArduPilot drops a target at distance zero, or not below the vehicle, silently.
LEAST_DISTANCE_M = 0.01
# Local and global position farther apart in time do not determine the local origin.
PAIR_MS = 200


def landing_target(
    vehicle: VehicleState,
    point_enu_m: ArrayLike,
    pose: PoseLike,
    now_ns: int,
    *,
    pose_timeout_s: float,
    frame: LocalFrame | None = None,
    correction: Correction | None = None,
) -> Any | None:
    """Return the message that guides the vehicle to a point, None if no valid one can be computed.

    Parameters
    ----------
    vehicle
        Its autopilot determines the frame.
    point_enu_m
        Landing point (3,) in the map frame, m.
    pose
        Newest pose; None is returned if it is older than `pose_timeout_s`.
    now_ns
        Companion clock.
    frame
        Map frame; without it, or while the local origin is unknown, there is no message in LOCAL_NED.
    correction
        From the autopilot's coordinates to those of the map, None for none.
    """
    if now_ns - pose.stamp_ns > pose_timeout_s * 1e9:
        return None
    point = np.asarray(point_enu_m, dtype=np.float64)
    if not all(np.isfinite(a).all() for a in (point, pose.position_enu_m, pose.rotation_enu_from_frd)):
        return None
    body = body_frd_m(point, pose)
    if vehicle.autopilot.landing_target_frame == mavlink.MAV_FRAME_BODY_FRD:
        body = _below(body, pose)
        return _message(mavlink.MAV_FRAME_BODY_FRD, body, body, now_ns)
    origin = None if frame is None else local_origin_enu_m(frame, vehicle)
    if origin is None:
        return None
    there = point if correction is None else correction.of_map(point)
    east, north, up = there - origin
    return _message(mavlink.MAV_FRAME_LOCAL_NED, np.array([north, east, -up]), body, now_ns)


def _below(body_m: Floats, pose: PoseLike) -> Floats:
    """Return a body vector (3,) to a place below the vehicle, lowered to there: the ground is never above."""
    down = -pose.rotation_enu_from_frd[2]
    short_m = LEAST_DISTANCE_M - float(body_m[2])
    return body_m if short_m <= 0 or down[2] <= 0 else np.asarray(body_m + down * (short_m / down[2]))


def _message(frame: int, target_m: Floats, body_m: Floats, now_ns: int) -> Any:
    forward, right, down = (float(value) for value in body_m)
    x, y, z = (float(value) for value in target_m)
    return mavlink.MAVLink_landing_target_message(
        max(1, now_ns // 1000),
        0,
        frame,
        # ArduPilot reads the angles as right and backward of straight down (AC_PrecLand_MAVLink).
        math.atan2(right, max(down, LEAST_DISTANCE_M)),
        math.atan2(-forward, max(down, LEAST_DISTANCE_M)),
        max(LEAST_DISTANCE_M, math.hypot(forward, right, down)),
        0.0,
        0.0,
        x,
        y,
        z,
        [1.0, 0.0, 0.0, 0.0],
        mavlink.LANDING_TARGET_TYPE_VISION_OTHER,
        1,
    )


def local_origin_enu_m(frame: LocalFrame, vehicle: VehicleState) -> Floats | None:
    """Return the autopilot's local origin in the map frame (3,), None while it is unknown.

    The local position is extrapolated to the time of the global one with the velocity and subtracted from it,
    so the result follows an origin that the estimator moves.
    """
    if vehicle.position_lla is None or vehicle.local_ned_m is None or vehicle.velocity_ned_ms is None:
        return None
    step_ms = boot_step_ms(vehicle.local_boot_ms, vehicle.position_boot_ms)
    if abs(step_ms) > PAIR_MS:
        return None
    local_ned = np.array(vehicle.local_ned_m) + np.array(vehicle.velocity_ned_ms) * (step_ms / 1000)
    local_enu = local_ned[[1, 0, 2]] * np.array([1.0, 1.0, -1.0])
    return np.asarray(frame.enu_m(*vehicle.position_lla) - local_enu)
