"""Kinematic shaping of setpoints: towards a place or a velocity, within speed, acceleration and jerk."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.cascade_control import approach
from sitl.vehicle.rigid_body import State

F64 = NDArray[np.float64]

JERK_MS3 = 5.0  # PSC_JERK_NE's default
CLIMB_MS2 = 1.0  # WPNAV_ACCEL_Z's default


def velocity_towards(place_enu_m: F64, state: State, parameters: Mapping[str, float]) -> F64:
    """Return the velocity (3,) east, north, up to a place and its hold there, as of the waypoint modes."""
    offset, out = place_enu_m - state.pos_enu_m, np.zeros(3)
    out[:2] = approach(offset[:2], parameters["WPNAV_SPEED"] / 100, parameters["WPNAV_ACCEL"] / 100)
    out[2] = vertical_towards(float(offset[2]), parameters)
    return out


def vertical_towards(offset_m: float, parameters: Mapping[str, float]) -> float:
    """Return the climb rate to a height that is `offset_m` above the vehicle."""
    limit = parameters["WPNAV_SPEED_UP" if offset_m > 0 else "WPNAV_SPEED_DN"]
    return float(approach(offset_m, limit / 100, CLIMB_MS2))


class HorizontalSetpoint:
    """Desired place, velocity and acceleration of a landing, as in AC_PosControl.

    The setpoint begins at the vehicle and moves within the limits of WPNAV_SPEED, WPNAV_ACCEL and the jerk,
    independently of the vehicle. A horizontal vector is a complex number, east + north i: NumPy's functions
    on two numbers cost more than the rest of a landing.

    Attributes
    ----------
    place, velocity, acceleration
        Setpoint, in m, m/s and m/s2.
    """

    def __init__(self) -> None:
        self.place = self.velocity = self.acceleration = 0j

    def reset(self, state: State) -> None:
        """Begin at the vehicle's place and velocity."""
        self.place, self.velocity, self.acceleration = _plane(state.pos_enu_m), _plane(state.vel_enu_ms), 0j

    def hold(self, place_enu_m: F64) -> None:
        """Stay at a place."""
        self.place, self.velocity, self.acceleration = _plane(place_enu_m), 0j, 0j

    def move(self, jump_enu_m: F64) -> None:
        """Apply a reset of the position estimate."""
        self.place += _plane(jump_enu_m)

    def move_to(self, goal_enu_m: F64, parameters: Mapping[str, float], dt_s: float) -> None:
        """Move towards a place (AP_Math/control.cpp: shape_pos_vel_accel_xy)."""
        most = parameters["WPNAV_ACCEL"] / 100
        self._advance(dt_s)
        gain, error = JERK_MS3 / most, _plane(goal_enu_m) - self.place
        length, speed = abs(error), 0.0
        if length > 0:
            closing = _dot(self.velocity, error) / length
            speed = braking_speed(length, gain, most)
            if speed * closing > 0:
                slope = gain if length <= most / gain**2 else most / speed
                speed -= slope * closing / gain
            fastest = parameters["WPNAV_SPEED"] / 100
            speed = min(max(speed, -fastest), fastest) / length
        self._accelerate((error * speed - self.velocity) * gain, most, dt_s)

    def move_with(self, wanted_ms: complex, parameters: Mapping[str, float], dt_s: float) -> None:
        """Change to a velocity (AP_Math/control.cpp: shape_vel_accel_xy)."""
        most = parameters["WPNAV_ACCEL"] / 100
        self._advance(dt_s)
        error = wanted_ms - self.velocity
        change = braking_speed(abs(error), JERK_MS3 / most, JERK_MS3)
        self._accelerate(error * change / abs(error) if error else 0j, most, dt_s)

    def followed_by(self, state: State) -> complex:
        """Return the velocity with which the vehicle follows: PSC_POSXY_P is 1."""
        return self.velocity + self.place - _plane(state.pos_enu_m)

    def _advance(self, dt_s: float) -> None:
        self.place += self.velocity * dt_s + 0.5 * self.acceleration * dt_s**2
        self.velocity += self.acceleration * dt_s

    def _accelerate(self, wanted: complex, most: float, dt_s: float) -> None:
        """Change the acceleration towards the wanted one: limit_accel_corner_xy, then shape_accel_xy."""
        speed = abs(self.velocity)
        if speed > 0:
            ahead = self.velocity / speed
            wanted = _shortened(wanted, 2 * most)
            along = _dot(wanted, ahead)
            across = wanted - along * ahead
            if along > 0:
                across = _shortened(across, most)
                along = min(along, math.sqrt(max(0.0, most**2 - abs(across) ** 2)))
            else:
                along = max(along, -most)
                across = _shortened(across, math.sqrt(max(0.0, most**2 - along**2)))
            wanted = across + along * ahead
        else:
            wanted = _shortened(wanted, most)
        self.acceleration += _shortened(wanted - self.acceleration, JERK_MS3 * dt_s)


def braking_speed(distance: float, gain: float, most: float) -> float:
    """Return a rate that falls to zero within a distance by a bounded deceleration (sqrt_controller)."""
    linear = most / gain**2
    if abs(distance) <= linear:
        return distance * gain
    return math.copysign(math.sqrt(2 * most * (abs(distance) - linear / 2)), distance)


def _plane(enu: F64) -> complex:
    return complex(float(enu[0]), float(enu[1]))


def _dot(one: complex, other: complex) -> float:
    return one.real * other.real + one.imag * other.imag


def _shortened(vector: complex, longest: float) -> complex:
    length = abs(vector)
    return vector if length <= longest else vector * (longest / length)
