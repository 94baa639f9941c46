"""From wanted velocity and heading to body rates and thrust, as a multirotor autopilot cascades it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sitl.jit import kernel
from sitl.state import State, multiply
from sitl.vehicle import GRAVITY_MS2

F64 = NDArray[np.float64]

MAX_TILT_RAD = math.radians(28.0)
MAX_RATE_RAD_S = 3.5
MAX_YAW_RATE_RAD_S = 1.2
ATTITUDE_GAIN_PER_S = 7.0
VELOCITY_GAIN_PER_S = 2.2
VERTICAL_GAIN_PER_S = 4.0
INTEGRAL_GAIN_PER_S2 = 0.6


@kernel()
def rate_command(quat: F64, wanted: F64) -> F64:
    """Return body rates that turn the estimated attitude to the wanted one."""
    error = multiply(np.array([quat[0], -quat[1], -quat[2], -quat[3]]), wanted)
    sign = 1.0 if error[0] >= 0 else -1.0
    out = np.empty(3)
    for i in range(3):
        limit = MAX_RATE_RAD_S if i < 2 else MAX_YAW_RATE_RAD_S
        out[i] = min(max(2 * ATTITUDE_GAIN_PER_S * sign * error[i + 1], -limit), limit)
    return out


def attitude_for(acc_enu_ms2: F64, yaw_rad: float) -> tuple[F64, float]:
    """Return the attitude and thrust (m/s2) that accelerate so, within the tilt limit."""
    up = max(2.0, GRAVITY_MS2 + float(acc_enu_ms2[2]))
    side = np.array([acc_enu_ms2[1], acc_enu_ms2[0]])  # north, east
    length = float(np.hypot(*side))
    longest = up * math.tan(MAX_TILT_RAD)
    if length > longest:
        side = side * (longest / length)
    down = np.array([-side[0], -side[1], up])  # body z axis (down) in NED is minus the thrust
    thrust = float(np.sqrt(down @ down))
    z = down / thrust
    ahead = np.array([math.cos(yaw_rad), math.sin(yaw_rad), 0.0])
    y = np.cross(z, ahead)
    y /= np.sqrt(float(y @ y))
    x = np.cross(y, z)
    return _quaternion(x, y, z), thrust


def _quaternion(x: F64, y: F64, z: F64) -> F64:
    """Return the quaternion whose rotation has these columns; tilts are small, so w is never near zero."""
    trace = float(x[0] + y[1] + z[2])
    if trace > -0.9:
        w = math.sqrt(1 + trace) / 2
        return np.array([w, (y[2] - z[1]) / (4 * w), (z[0] - x[2]) / (4 * w), (x[1] - y[0]) / (4 * w)])
    # Heading near south: the z component is the large one.
    k = math.sqrt(max(1e-9, 1 - float(x[0]) - float(y[1]) + float(z[2]))) / 2
    return np.array([(x[1] - y[0]) / (4 * k), (z[0] + x[2]) / (4 * k), (y[2] + z[1]) / (4 * k), k])


def approach(error_m: F64 | float, speed_ms: float, acc_ms2: float, gain_per_s: float = 1.0) -> F64 | float:
    """Return the velocity towards an offset, slowing down in time (ArduPilot's square-root controller)."""
    distance = float(np.sqrt(np.sum(np.square(error_m))))
    if distance < 1e-9:
        return error_m * 0.0
    linear = acc_ms2 / gain_per_s**2
    wanted = gain_per_s * distance if distance < linear else math.sqrt(2 * acc_ms2 * (distance - linear / 2))
    return error_m * (min(speed_ms, wanted) / distance)


class VelocityLoop:
    """Velocity controller with an integrator against wind."""

    def __init__(self) -> None:
        self._integral = np.zeros(3)
        self._wanted = np.zeros(3)

    def reset(self, velocity_enu_ms: F64) -> None:
        """Start from the present velocity."""
        self._integral[:] = 0
        self._wanted = velocity_enu_ms.copy()

    def acceleration(self, wanted_enu_ms: F64, state: State, dt_s: float, acc_ms2: float) -> F64:
        """Return the acceleration (3,) east, north, up for a velocity wanted, itself shaped by `acc_ms2`."""
        change = wanted_enu_ms - self._wanted
        longest = acc_ms2 * dt_s
        length = float(np.sqrt(change @ change))
        self._wanted = self._wanted + (change if length <= longest else change * (longest / length))
        error = self._wanted - state.vel_enu_ms
        self._integral += INTEGRAL_GAIN_PER_S2 * error * dt_s
        np.clip(self._integral, -3.0, 3.0, out=self._integral)
        gain = np.array([VELOCITY_GAIN_PER_S, VELOCITY_GAIN_PER_S, VERTICAL_GAIN_PER_S])
        return np.asarray(np.clip(gain * error + self._integral, -6.0, 6.0))
