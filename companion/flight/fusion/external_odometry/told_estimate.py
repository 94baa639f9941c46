"""Estimate of the vehicle's pose on the map by an external odometry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from companion.flight.fusion.external_odometry.pose_pair import PosePair
from companion.flight.fusion.external_odometry.shift_filter import RATE, SHIFT, YAW, ShiftFilter
from companion.flight.fusion.odometry.odometry_estimate import OdometryEstimate
from companion.flight.geometry.axes import quaternion_wxyz

Floats = NDArray[np.float64]

VELOCITY_MS = 0.05  # standard deviation of a velocity beside its drift
WAY_SHARE = 0.005  # drift of an odometry that states no covariance, of its way


def told_estimate(
    pair: PosePair,
    filtered: ShiftFilter,
    rotation_map_from_odometry: Floats,
    velocity_enu_ms: Floats,
    way_m: float,
    resets: int,
) -> OdometryEstimate:
    """Return the estimate at the time of a pose; all axes are observed.

    Parameters
    ----------
    filtered
        Error of the autopilot's pose.
    velocity_enu_ms
        Of the vehicle on the map, (3,).
    way_m
        Flown since the alignment.
    """
    state, errors = filtered.state, filtered.covariance
    body = Rotation.from_rotvec([0.0, 0.0, state[YAW]]).as_matrix() @ pair.auto
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = rotation_map_from_odometry
    covariance = turn @ pair.covariance @ turn.T
    covariance[:3, :3] += errors[SHIFT, SHIFT]
    covariance[5, 5] += errors[YAW, YAW]
    if not pair.is_stated:
        covariance[:3, :3] += np.eye(3) * (WAY_SHARE * way_m) ** 2
    return OdometryEstimate(
        stamp_ns=pair.at_ns,
        position_enu_m=pair.auto_m + state[SHIFT],
        velocity_enu_ms=velocity_enu_ms,
        quat_wxyz=quaternion_wxyz(body),
        pose_covariance=covariance,
        velocity_covariance=errors[RATE, RATE] + np.eye(3) * VELOCITY_MS**2,
        observed=np.ones(6, np.bool_),
        resets=resets,
    )
