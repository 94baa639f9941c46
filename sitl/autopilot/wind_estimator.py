"""Wind estimate of the autopilot by drag fusion, and its message WIND."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.vehicle.multirotor import GRAVITY_MS2
from sitl.vehicle.rigid_body import State, ned, rotate

F64 = NDArray[np.float64]

SMOOTHING_S = 3.0
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


class WindEstimator:
    """Wind from the accelerometer's horizontal body axes, as EKF3 estimates it with EK3_DRAG_MCOEF.

    Thrust has no part along these axes, so what is measured there is the rotors' momentum drag: minus the
    coefficient times the airspeed. The vertical wind is taken as zero. ArduCopter sends no WIND without an
    estimate, which is its default.

    Attributes
    ----------
    wind_ned_ms
        Velocity of the air (3,), None without an estimate.
    alter
        Applied to each message by a fault; its None is sent as nothing.
    """

    def __init__(self) -> None:
        self.wind_ned_ms: F64 | None = None
        self.alter: Callable[[Any], Any] | None = None

    def restart(self) -> None:
        """Discard the estimate."""
        self.wind_ned_ms = None

    def update(self, dt_s: float, estimate: State, airborne: bool, drag_per_s: float) -> None:
        """Update the estimate, `dt_s` after the last; none on the ground or without a coefficient."""
        if not airborne or drag_per_s <= 0:
            self.wind_ned_ms = None
            return
        quat, velocity = estimate.quat_wxyz, ned(estimate.vel_enu_ms)
        felt = rotate(quat * CONJUGATE, ned(estimate.acc_enu_ms2 + np.array([0.0, 0.0, GRAVITY_MS2])))
        level = rotate(quat, np.array([-felt[0] / drag_per_s, -felt[1] / drag_per_s, 0.0]))
        down = rotate(quat, np.array([0.0, 0.0, 1.0]))
        airspeed = level + down * (velocity[2] - level[2]) / down[2]
        wind = velocity - airspeed
        if self.wind_ned_ms is None:
            self.wind_ned_ms = wind
        else:
            self.wind_ned_ms = self.wind_ned_ms + (wind - self.wind_ned_ms) * (dt_s / SMOOTHING_S)

    def message(self) -> Any:
        """Return WIND as ArduPilot sends it, its direction from -180 to 180; None without an estimate."""
        if self.wind_ned_ms is None:
            return None
        north, east, down = (float(v) for v in self.wind_ned_ms)
        sent = mavlink.MAVLink_wind_message(
            math.degrees(math.atan2(-east, -north)), math.sqrt(north**2 + east**2 + down**2), down
        )
        return sent if self.alter is None else self.alter(sent)
