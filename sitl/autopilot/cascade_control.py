"""Cascaded multirotor control: from velocity and heading setpoints to body rates and thrust."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sitl.compilation import kernel_for_any_types
from sitl.vehicle.multirotor import GRAVITY_MS2
from sitl.vehicle.rigid_body import State, multiply

F64 = NDArray[np.float64]
Axis = tuple[float, float, float]

MAX_TILT_RAD = math.radians(28.0)
MAX_RATE_RAD_S = 3.5
MAX_YAW_RATE_RAD_S = 1.2
ATTITUDE_GAIN_PER_S = 7.0
VELOCITY_GAIN_PER_S = 2.2
VERTICAL_GAIN_PER_S = 4.0
INTEGRAL_GAIN_PER_S2 = 1.0  # ArduCopter: PSC_VELXY_I


@kernel_for_any_types
def rate_command(quat: F64, wanted: F64) -> F64:
    """Return body rates that rotate the estimated attitude to the commanded one."""
    error = multiply(np.array([quat[0], -quat[1], -quat[2], -quat[3]]), wanted)
    sign = 1.0 if error[0] >= 0 else -1.0
    out = np.empty(3)
    for i in range(3):
        limit = MAX_RATE_RAD_S if i < 2 else MAX_YAW_RATE_RAD_S
        out[i] = min(max(2 * ATTITUDE_GAIN_PER_S * sign * error[i + 1], -limit), limit)
    return out


def attitude_for(acc_enu_ms2: F64, yaw_rad: float) -> tuple[F64, float]:
    """Return the attitude and thrust (m/s2) for an acceleration, within the tilt limit."""
    up = max(2.0, GRAVITY_MS2 + float(acc_enu_ms2[2]))
    north, east = float(acc_enu_ms2[1]), float(acc_enu_ms2[0])
    length = math.hypot(north, east)
    longest = up * math.tan(MAX_TILT_RAD)
    if length > longest:
        north, east = north * longest / length, east * longest / length
    # The body's z axis (down) in north, east, down is minus the thrust. Plain floats are used because this
    # runs at 100 Hz, and NumPy's functions on three numbers cost more than the rest of the autopilot.
    thrust = math.sqrt(north * north + east * east + up * up)
    z = (-north / thrust, -east / thrust, up / thrust)
    ahead, right = math.cos(yaw_rad), math.sin(yaw_rad)
    y = (-z[2] * right, z[2] * ahead, z[0] * right - z[1] * ahead)
    long = math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
    y = (y[0] / long, y[1] / long, y[2] / long)
    x = (y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0])
    return _quaternion(x, y, z), thrust


def _quaternion(x: Axis, y: Axis, z: Axis) -> F64:
    """Return the quaternion of a rotation with these columns, for small tilts."""
    trace = x[0] + y[1] + z[2]
    if trace > -0.9:
        w = math.sqrt(1 + trace) / 2
        return np.array([w, (y[2] - z[1]) / (4 * w), (z[0] - x[2]) / (4 * w), (x[1] - y[0]) / (4 * w)])
    # Heading near south: the z component is the large one.
    k = math.sqrt(max(1e-9, 1 - x[0] - y[1] + z[2])) / 2
    return np.array([(x[1] - y[0]) / (4 * k), (z[0] + x[2]) / (4 * k), (y[2] + z[1]) / (4 * k), k])


def approach(error_m: F64 | float, speed_ms: float, acc_ms2: float, gain_per_s: float = 1.0) -> F64 | float:
    """Return the velocity towards an offset with timely braking (ArduPilot's square-root controller)."""
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
        """Restart from the current velocity."""
        self._integral[:] = 0
        self._wanted = velocity_enu_ms.copy()

    def acceleration(self, wanted_enu_ms: F64, state: State, dt_s: float, acc_ms2: float) -> F64:
        """Return the acceleration (3,) east, north, up for a velocity setpoint, rate-limited by `acc_ms2`."""
        gains = np.array([VELOCITY_GAIN_PER_S, VELOCITY_GAIN_PER_S, VERTICAL_GAIN_PER_S])
        return _accelerate(
            self._wanted, self._integral, wanted_enu_ms, state.vel_enu_ms, gains, acc_ms2 * dt_s, dt_s
        )


@kernel_for_any_types
def _accelerate(
    wanted: F64, integral: F64, goal: F64, velocity: F64, gains: F64, longest: float, dt: float
) -> F64:
    """Move the shaped velocity towards its goal, integrate the error, and return the acceleration."""
    change = goal - wanted
    length = np.sqrt(change[0] ** 2 + change[1] ** 2 + change[2] ** 2)
    share = 1.0 if length <= longest else longest / length
    out = np.empty(3)
    for i in range(3):
        wanted[i] += share * change[i]
        error = wanted[i] - velocity[i]
        integral[i] = min(max(integral[i] + INTEGRAL_GAIN_PER_S2 * error * dt, -3.0), 3.0)
        out[i] = min(max(gains[i] * error + integral[i], -6.0), 6.0)
    return out
