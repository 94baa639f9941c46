"""Kinematic shaping of setpoints: towards a place or a velocity, within speed, acceleration and jerk."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.cascade_control import approach
from sitl.compilation import kernel_for_any_types
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
    """Desired place, velocity and acceleration (2,) east, north of a landing, as in AC_PosControl.

    Attributes
    ----------
    place_m, velocity_ms, acceleration_ms2
        Setpoint; it begins at the vehicle and moves within the limits of WPNAV_SPEED, WPNAV_ACCEL and the
        jerk, independently of the vehicle.
    """

    def __init__(self) -> None:
        self.place_m, self.velocity_ms, self.acceleration_ms2 = np.zeros(2), np.zeros(2), np.zeros(2)

    def reset(self, state: State) -> None:
        """Begin at the vehicle's place and velocity."""
        self.place_m, self.velocity_ms = state.pos_enu_m[:2].copy(), state.vel_enu_ms[:2].copy()
        self.acceleration_ms2 = np.zeros(2)

    def move_to(self, goal_m: F64, parameters: Mapping[str, float], dt_s: float) -> None:
        """Move towards a place."""
        fastest, most = parameters["WPNAV_SPEED"] / 100, parameters["WPNAV_ACCEL"] / 100
        _to_place(self.place_m, self.velocity_ms, self.acceleration_ms2, goal_m, fastest, most, dt_s)

    def move_with(self, wanted_ms: F64, parameters: Mapping[str, float], dt_s: float) -> None:
        """Change to a velocity."""
        most = parameters["WPNAV_ACCEL"] / 100
        _to_velocity(self.place_m, self.velocity_ms, self.acceleration_ms2, wanted_ms, most, dt_s)

    def followed_by(self, state: State) -> F64:
        """Return the velocity (2,) with which the vehicle follows: PSC_POSXY_P is 1."""
        return self.velocity_ms + self.place_m - state.pos_enu_m[:2]


@kernel_for_any_types
def braking_speed(distance: float, gain: float, most: float) -> float:
    """Return a rate that falls to zero within a distance by a bounded deceleration (sqrt_controller)."""
    linear = most / gain**2
    if distance > linear:
        return math.sqrt(2 * most * (distance - linear / 2))
    if distance < -linear:
        return -math.sqrt(2 * most * (-distance - linear / 2))
    return distance * gain


@kernel_for_any_types
def _to_place(
    place: F64, velocity: F64, acceleration: F64, goal: F64, fastest: float, most: float, dt: float
) -> None:
    """Advance a setpoint towards a goal (AP_Math/control.cpp: shape_pos_vel_accel_xy)."""
    _advance(place, velocity, acceleration, dt)
    gain = JERK_MS3 / most
    error = goal - place
    length = math.sqrt(error[0] ** 2 + error[1] ** 2)
    speed = 0.0
    if length > 0:
        closing = (velocity[0] * error[0] + velocity[1] * error[1]) / length
        speed = braking_speed(length, gain, most)
        if speed * closing > 0:
            slope = gain if length <= most / gain**2 else most / speed
            speed -= slope * closing / gain
        speed = min(max(speed, -fastest), fastest) / length
    wanted = (error * speed - velocity) * gain
    _limit_jerk(velocity, acceleration, wanted, most, dt)


@kernel_for_any_types
def _to_velocity(place: F64, velocity: F64, acceleration: F64, goal: F64, most: float, dt: float) -> None:
    """Advance a setpoint that changes to a velocity (AP_Math/control.cpp: shape_vel_accel_xy)."""
    _advance(place, velocity, acceleration, dt)
    error = goal - velocity
    length = math.sqrt(error[0] ** 2 + error[1] ** 2)
    share = braking_speed(length, JERK_MS3 / most, JERK_MS3) / length if length > 0 else 0.0
    _limit_jerk(velocity, acceleration, error * share, most, dt)


@kernel_for_any_types
def _advance(place: F64, velocity: F64, acceleration: F64, dt: float) -> None:
    """Integrate a setpoint over a step (update_pos_vel_accel_xy)."""
    for i in range(2):
        place[i] += velocity[i] * dt + 0.5 * acceleration[i] * dt**2
        velocity[i] += acceleration[i] * dt


@kernel_for_any_types
def _limit_jerk(velocity: F64, acceleration: F64, wanted: F64, most: float, dt: float) -> None:
    """Change the acceleration towards the wanted one: limit_accel_corner_xy, then shape_accel_xy."""
    speed = math.sqrt(velocity[0] ** 2 + velocity[1] ** 2)
    ahead = velocity / speed if speed > 0 else np.zeros(2)
    _shorten(wanted, 2 * most if speed > 0 else most)
    along = wanted[0] * ahead[0] + wanted[1] * ahead[1]
    across = wanted - along * ahead
    if speed > 0 and along > 0:
        _shorten(across, most)
        room = math.sqrt(max(0.0, most**2 - across[0] ** 2 - across[1] ** 2))
        along = min(along, room)
    elif speed > 0:
        along = max(along, -most)
        _shorten(across, math.sqrt(max(0.0, most**2 - along**2)))
    change = across + along * ahead - acceleration
    _shorten(change, JERK_MS3 * dt)
    acceleration += change


@kernel_for_any_types
def _shorten(vector: F64, longest: float) -> None:
    """Limit a vector's length in place."""
    length = math.sqrt(vector[0] ** 2 + vector[1] ** 2)
    if length > longest:
        vector *= longest / length
