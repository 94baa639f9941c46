"""Poses as ROS messages: map is east-north-up, base_link forward-left-up (REP 103, REP 105)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.flight.geometry.pose import Pose
from companion.flight.rmw.message_types import message_types

MAP, BODY = "map", "base_link"
FRD_FROM_FLU = np.diag([1.0, -1.0, -1.0])
UNKNOWN_VARIANCE = 1e6
LEVEL = (0.0, 0.0, 0.0, 1.0)

_make = message_types().make


def header(at_ns: int, frame: str = MAP) -> Any:
    """Return a header; at_ns since 1970."""
    return _make("std_msgs/msg/Header", time(at_ns), frame)


def time(at_ns: int) -> Any:
    """Return a time; at_ns since 1970."""
    return _make("builtin_interfaces/msg/Time", at_ns // 1_000_000_000, at_ns % 1_000_000_000)


def place(enu_m: NDArray[np.float64]) -> Any:
    """Return a point of the map, from (3,)."""
    return _make("geometry_msgs/msg/Point", *(float(v) for v in enu_m))


def vector(xyz: NDArray[np.float64]) -> Any:
    """Return a vector, from (3,)."""
    return _make("geometry_msgs/msg/Vector3", *(float(v) for v in xyz))


def pose_at(enu_m: NDArray[np.float64], xyzw: tuple[float, ...] = LEVEL) -> Any:
    """Return a pose in the map."""
    return _make("geometry_msgs/msg/Pose", place(enu_m), _make("geometry_msgs/msg/Quaternion", *xyzw))


def landing_point(enu_m: NDArray[np.float64], at_ns: int) -> Any:
    """Return a landing point as a pose without a heading."""
    return _make("geometry_msgs/msg/PoseStamped", header(at_ns), pose_at(enu_m))


def odometry(pose: Pose, at_ns: int) -> Any:
    """Return the vehicle's pose in the map, and its velocity in its own axes.

    Covariances are zero, unknown, but those of the angular rates, which the pose does not hold, are huge.
    """
    where = _make("geometry_msgs/msg/PoseWithCovariance", _pose(pose), np.zeros(36))
    velocity_flu_ms = _enu_from_flu(pose).T @ pose.velocity_enu_ms
    variances = np.diag([0.0] * 3 + [UNKNOWN_VARIANCE] * 3).ravel()
    twist = _make("geometry_msgs/msg/Twist", vector(velocity_flu_ms), vector(np.zeros(3)))
    moves = _make("geometry_msgs/msg/TwistWithCovariance", twist, variances)
    return _make("nav_msgs/msg/Odometry", header(at_ns), BODY, where, moves)


def transforms(pose: Pose, at_ns: int) -> Any:
    """Return the transform of base_link into the map."""
    turn = _make("geometry_msgs/msg/Quaternion", *_xyzw(pose))
    transform = _make("geometry_msgs/msg/Transform", vector(pose.position_enu_m), turn)
    one = _make("geometry_msgs/msg/TransformStamped", header(at_ns), BODY, transform)
    return _make("tf2_msgs/msg/TFMessage", [one])


def _pose(pose: Pose) -> Any:
    return pose_at(pose.position_enu_m, _xyzw(pose))


def _enu_from_flu(pose: Pose) -> NDArray[np.float64]:
    return np.asarray(pose.rotation_enu_from_frd @ FRD_FROM_FLU)


def _xyzw(pose: Pose) -> tuple[float, ...]:
    from scipy.spatial.transform import Rotation

    return tuple(float(v) for v in Rotation.from_matrix(_enu_from_flu(pose)).as_quat())
