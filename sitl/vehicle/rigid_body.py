"""State of a rigid body, and its rotations."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sitl.compilation import kernel_for_any_types

F64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class State:
    """Position and velocity east, north, up; attitude body forward-right-down to north-east-down.

    quat_wxyz: (4,) unit. rates_frd_rad_s: (3,). acc_enu_ms2: (3,) without gravity's reaction.
    """

    pos_enu_m: F64
    vel_enu_ms: F64
    quat_wxyz: F64
    rates_frd_rad_s: F64
    acc_enu_ms2: F64


@kernel_for_any_types
def multiply(a: F64, b: F64) -> F64:
    """Return the Hamilton product of two quaternions."""
    out = np.empty(4)
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2]
    out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1]
    out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]
    return out


@kernel_for_any_types
def rotate(q: F64, v: F64) -> F64:
    """Return q v q*: a vector rotated from body to world."""
    x, y, z, w = q[1], q[2], q[3], q[0]
    tx, ty, tz = 2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])
    out = np.empty(3)
    out[0] = v[0] + w * tx + y * tz - z * ty
    out[1] = v[1] + w * ty + z * tx - x * tz
    out[2] = v[2] + w * tz + x * ty - y * tx
    return out


def from_euler(roll: float, pitch: float, yaw: float) -> F64:
    """Return the quaternion of aerospace roll, pitch, yaw (rad)."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def to_euler(q: F64) -> tuple[float, float, float]:
    """Return roll, pitch, yaw (rad) of a quaternion."""
    w, x, y, z = (float(v) for v in q)
    return (
        math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x)))),
        math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )


def ned(enu: F64) -> F64:
    """Return north, east, down of east, north, up (and vice versa)."""
    return np.array([enu[1], enu[0], -enu[2]])
