"""ODOMETRY in the frames that each autopilot accepts.

Frame, estimator and times are those of its `ExternalPosition`. All versions of the parameter files understand
ODOMETRY; VISION_POSITION_ESTIMATE, which has no velocity and no quality, is never sent.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.flight.fusion.odometry.odometry_estimate import OdometryEstimate
from companion.flight.geometry.axes import Floats, rotation_enu_from_frd
from companion.flight.link.autopilots.autopilot_interface import ExternalPosition
from companion.flight.link.vehicle_state import VehicleState, unit_quaternion

# Near +-90 degrees of pitch, roll and yaw are not determined.
LEAST_COSINE = 0.02
# Beyond these standard deviations there is no position, m, velocity, m/s, or attitude, rad.
MOST_POSITION_M, MOST_VELOCITY_MS, MOST_ANGLE_RAD = 10.0, 10.0, 1.0
_NED_FROM_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def odometry_message(
    vehicle: VehicleState, estimate: OdometryEstimate, origin_enu_m: ArrayLike | None, now_ns: int
) -> Any | None:
    """Return the message that aids the autopilot's estimator, None if no valid one can be computed.

    Parameters
    ----------
    vehicle
        Its autopilot determines frame and estimator type; without an `external_position` there is no message.
    estimate
        None is returned before `earliest_ns`, if it is older than `oldest_ns`, not finite, if its covariances
        are not positive definite or too large, or if a position axis is not observed: that axis holds the
        autopilot's own estimate, which would confirm itself.
    origin_enu_m
        The autopilot's local origin in the map frame (3,), m; None while unknown.
    now_ns
        Companion clock.
    """
    accepted = vehicle.autopilot.external_position
    if accepted is None or origin_enu_m is None:
        return None
    if not earliest_ns(vehicle, estimate) <= now_ns <= estimate.stamp_ns + accepted.oldest_ns:
        return None
    origin = np.asarray(origin_enu_m, dtype=np.float64)
    numbers = (
        estimate.position_enu_m,
        estimate.velocity_enu_ms,
        estimate.quat_wxyz,
        estimate.pose_covariance,
        estimate.velocity_covariance,
        origin,
    )
    if not all(np.isfinite(a).all() for a in numbers) or not estimate.observed[:3].all():
        return None
    w, x, y, z = (float(v) for v in estimate.quat_wxyz)
    quaternion = unit_quaternion(w, x, y, z)
    if quaternion is None:
        return None
    ned_from_frd = _NED_FROM_ENU @ rotation_enu_from_frd(quaternion)
    pose_covariance = _pose_covariance(estimate.pose_covariance, ned_from_frd)
    frd_from_enu = ned_from_frd.T @ _NED_FROM_ENU
    velocity_covariance = frd_from_enu @ estimate.velocity_covariance @ frd_from_enu.T
    if pose_covariance is None or not _is_covariance(velocity_covariance, [MOST_VELOCITY_MS] * 3):
        return None
    return _message(
        accepted,
        max(1, earliest_ns(vehicle, estimate) // 1000),
        _NED_FROM_ENU @ (estimate.position_enu_m - origin),
        quaternion,
        frd_from_enu @ estimate.velocity_enu_ms,
        pose_covariance,
        velocity_covariance,
        estimate.resets % 256,
        max(1, round(100 * float(estimate.observed.mean()))),
    )


def earliest_ns(vehicle: VehicleState, estimate: OdometryEstimate) -> int:
    """Return the time from which on an estimate may be sent, which is also the message's stamp."""
    accepted = vehicle.autopilot.external_position
    return estimate.stamp_ns + (0 if accepted is None else accepted.delay_ns)


def clock_message(now_ns: int) -> Any:
    """Return the VISION_SPEED_ESTIMATE without a velocity that shows ArduPilot the companion's clock.

    ArduPilot does not use TIMESYNC for odometry, but takes the least delay of the last 100 stamps of a link
    as none. Stamped at the moment of sending, this message makes that delay the link's, not that of the
    scans. NaN is fused nowhere; an ODOMETRY of NaN would first go through the code that aligns its position
    (AP_VisualOdom_MAV.cpp). It also counts as a sign of life of the odometry, without which a vehicle on the
    ground, whose LiDAR sees too little there, could not be armed.
    """
    return mavlink.MAVLink_vision_speed_estimate_message(
        max(1, now_ns // 1000), *(math.nan,) * 3, [math.nan] * 9, 0
    )


def _message(
    accepted: ExternalPosition,
    time_us: int,
    position_ned_m: Floats,
    quaternion: tuple[float, ...],
    velocity_frd_ms: Floats,
    pose_covariance: Floats,
    velocity_covariance: Floats,
    resets: int,
    quality: int,
) -> Any:
    rates = np.full((6, 6), math.nan)  # of the body: not estimated
    rates[:3, :3] = velocity_covariance
    return mavlink.MAVLink_odometry_message(
        time_us,
        accepted.frame,
        mavlink.MAV_FRAME_BODY_FRD,
        *(float(v) for v in position_ned_m),
        list(quaternion),
        *(float(v) for v in velocity_frd_ms),
        *(math.nan,) * 3,
        _upper_triangle(pose_covariance),
        _upper_triangle(rates),
        resets,
        accepted.estimator,
        quality,
    )


def _pose_covariance(covariance_enu: Floats, ned_from_frd: Floats) -> Floats | None:
    """Return the covariance of north, east, down, roll, pitch, yaw (6, 6), None if it is not one."""
    euler_from_turn = _euler_from_turn(ned_from_frd)
    if euler_from_turn is None:
        return None
    jacobian = np.zeros((6, 6))
    jacobian[:3, :3] = _NED_FROM_ENU
    jacobian[3:, 3:] = euler_from_turn @ _NED_FROM_ENU  # a proper rotation: it turns rotation vectors too
    covariance = np.asarray(jacobian @ covariance_enu @ jacobian.T)
    most = [MOST_POSITION_M] * 3 + [MOST_ANGLE_RAD] * 3
    return covariance if _is_covariance(covariance, most) else None


def _euler_from_turn(ned_from_frd: Floats) -> Floats | None:
    """Return the derivative (3, 3) of roll, pitch, yaw by a small turn about north, east, down."""
    cosine = math.hypot(ned_from_frd[0, 0], ned_from_frd[1, 0])
    if cosine < LEAST_COSINE:
        return None
    c, s = ned_from_frd[0, 0] / cosine, ned_from_frd[1, 0] / cosine
    turn_from_euler = np.array(
        [[ned_from_frd[0, 0], -s, 0.0], [ned_from_frd[1, 0], c, 0.0], [ned_from_frd[2, 0], 0.0, 1.0]]
    )
    return np.linalg.inv(turn_from_euler)


def _is_covariance(matrix: Floats, most: list[float]) -> bool:
    """Return whether a matrix is positive definite, and its standard deviations are no larger than `most`."""
    if not np.allclose(matrix, matrix.T, rtol=1e-6, atol=1e-12):
        return False
    within = np.diagonal(matrix) <= np.square(most)
    return bool(within.all() and np.linalg.eigvalsh(matrix)[0] > 0)


def _upper_triangle(matrix: Floats) -> list[float]:
    """Return the upper triangle row by row: 21 numbers of a (6, 6) matrix."""
    return [float(v) for v in matrix[np.triu_indices(6)]]
