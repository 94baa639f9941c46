"""Axis conversions between the map's east-north-up and the vehicle's forward-right-down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
_ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


class PoseLike(Protocol):
    """Position and attitude of the vehicle at a time of the companion clock."""

    @property
    def stamp_ns(self) -> int: ...

    @property
    def position_enu_m(self) -> Floats: ...

    @property
    def rotation_enu_from_frd(self) -> Floats: ...


def body_frd_m(points_enu_m: ArrayLike, pose: PoseLike) -> Floats:
    """Return points of the map (..., 3) in body axes relative to the vehicle, m."""
    offset = np.asarray(points_enu_m, dtype=np.float64) - pose.position_enu_m
    return np.asarray(offset @ pose.rotation_enu_from_frd)


def heading_rad(rotation_enu_from_frd: Floats) -> float:
    """Return the heading, rad clockwise from north."""
    east, north = rotation_enu_from_frd[:2, 0]
    return math.atan2(east, north)


def enu_from_level(pose: PoseLike) -> Floats:
    """Return the rotation (3, 3) of level forward-right-down (heading only) into east-north-up."""
    heading = heading_rad(pose.rotation_enu_from_frd)
    sine, cosine = math.sin(heading), math.cos(heading)
    return np.array([[sine, cosine, 0.0], [cosine, -sine, 0.0], [0.0, 0.0, -1.0]])


def level_frd_m(points_enu_m: ArrayLike, pose: PoseLike) -> Floats:
    """Return points of the map (..., 3) in level forward-right-down relative to the vehicle, m."""
    offset = np.asarray(points_enu_m, dtype=np.float64) - pose.position_enu_m
    return np.asarray(offset @ enu_from_level(pose))


def rotation_enu_from_frd(quat_wxyz: Sequence[float] | Floats) -> Floats:
    """Return the rotation (3, 3) of body forward-right-down into east-north-up.

    Parameters
    ----------
    quat_wxyz
        Unit quaternion of body forward-right-down into north-east-down, as in ATTITUDE_QUATERNION.
    """
    w, x, y, z = quat_wxyz
    ned_from_frd = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return np.asarray(_ENU_FROM_NED @ ned_from_frd)


def quaternion_wxyz(rotation_enu_from_frd: Floats) -> Floats:
    """Return the unit quaternion (4,) of body forward-right-down into north-east-down."""
    return np.asarray(Rotation.from_matrix(_ENU_FROM_NED @ rotation_enu_from_frd).as_quat())[[3, 0, 1, 2]]
