"""Vehicle pose, and its short extrapolation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.flight.geometry.axes import rotation_enu_from_frd

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Pose:
    """Position, velocity and attitude of the vehicle.

    stamp_ns : companion clock. position_enu_m, velocity_enu_ms : (3,) in the map frame.
    quat_wxyz : (4,), rotation of body forward-right-down into north-east-down.
    epoch : changes whenever the autopilot's position estimate jumps.
    """

    stamp_ns: int
    position_enu_m: Floats
    velocity_enu_ms: Floats
    quat_wxyz: Floats
    epoch: int

    @property
    def rotation_enu_from_frd(self) -> Floats:
        """Rotation (3, 3) of body forward-right-down into east-north-up."""
        w, x, y, z = (float(v) for v in self.quat_wxyz)
        return rotation_enu_from_frd((w, x, y, z))


def turned(quat_wxyz: Floats, rates_frd_rads: Floats, seconds: float) -> Floats:
    """Return the attitude after `seconds` of constant body rates (rad/s)."""
    angle = float(np.linalg.norm(rates_frd_rads)) * seconds
    if angle == 0:
        return quat_wxyz.copy()
    axis = rates_frd_rads * (seconds / angle)
    half = angle / 2
    tw, (tx, ty, tz) = math.cos(half), axis * math.sin(half)
    w, x, y, z = quat_wxyz
    return np.array(
        [
            w * tw - x * tx - y * ty - z * tz,
            w * tx + x * tw + y * tz - z * ty,
            w * ty - x * tz + y * tw + z * tx,
            w * tz + x * ty - y * tx + z * tw,
        ]
    )
