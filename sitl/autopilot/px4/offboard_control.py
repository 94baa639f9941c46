"""OFFBOARD: the signal that it needs, and its setpoints (offboardCheck.cpp, mavlink_receiver.cpp)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.vehicle.rigid_body import State, to_euler

F64 = NDArray[np.float64]

_POSITION_BIT, _VELOCITY_BIT, _ACCELERATION_BIT, _YAW_BIT, _YAW_RATE_BIT = 0, 3, 6, 10, 11
CLIMB_MS = 0.3


class OffboardControl:
    """Setpoint of OFFBOARD: a position, a velocity or both, axis by axis, where NaN is none.

    Attributes
    ----------
    position_enu_m, velocity_enu_ms, yaw_rad, yaw_rate_rad_s
        Setpoint; it is flown on until the next one.
    """

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._p = parameters
        self.position_enu_m, self.velocity_enu_ms = np.full(3, np.nan), np.full(3, np.nan)
        self.yaw_rad = self.yaw_rate_rad_s = math.nan
        self._heard_ns: int | None = None
        self._needs_position = False

    def has_signal(self, now_ns: int, position_ok: bool) -> bool:
        """Return whether setpoints come now that can be flown (offboardCheck.cpp)."""
        fresh = self._heard_ns is not None and now_ns - self._heard_ns < self._p["COM_OF_LOSS_T"] * 1e9
        return fresh and position_ok

    def enter(self, state: State) -> None:
        """Hold the place until the first setpoint."""
        self.position_enu_m, self.velocity_enu_ms = state.pos_enu_m.copy(), np.full(3, np.nan)
        self.yaw_rad = self.yaw_rate_rad_s = math.nan

    def receive(self, message: Any, estimate: State, now_ns: int, *, in_control: bool) -> str | None:
        """Process a setpoint, which acts in OFFBOARD alone; return the text of a refusal."""
        mask = message.type_mask
        position = _used((message.y, message.x, -message.z), mask, _POSITION_BIT)
        velocity = _used((message.vy, message.vx, -message.vz), mask, _VELOCITY_BIT)
        if message.coordinate_frame == mavlink.MAV_FRAME_BODY_NED:
            position = np.full(3, np.nan)
            velocity = np.full(3, np.nan) if np.isnan(velocity).any() else _turned(velocity, estimate)
        elif message.coordinate_frame != mavlink.MAV_FRAME_LOCAL_NED:
            frame = message.coordinate_frame
            return f"SET_POSITION_TARGET_LOCAL_NED coordinate frame {frame} unsupported\t"
        accelerates = (mask >> _ACCELERATION_BIT) & 0b111 != 0b111
        if np.isnan(position).all() and np.isnan(velocity).all() and not accelerates:
            return "SET_POSITION_TARGET_LOCAL_NED invalid\t"
        self._heard_ns = now_ns
        if in_control:
            self.position_enu_m, self.velocity_enu_ms = position, velocity
            self.yaw_rad = math.nan if mask >> _YAW_BIT & 1 else float(message.yaw)
            self.yaw_rate_rad_s = math.nan if mask >> _YAW_RATE_BIT & 1 else float(message.yaw_rate)
        return None

    @property
    def wants_up(self) -> bool:
        """True if the setpoint takes a landed vehicle off."""
        return bool(self.velocity_enu_ms[2] > CLIMB_MS)

    def move(self, jump_enu_m: F64) -> None:
        """A reset of the position estimate moves no setpoint: it is in the frame of its sender."""

    def velocity(self, state: State) -> F64:
        """Return the velocity setpoint (3,) of the position controller (PositionControl.cpp)."""
        p = self._p
        gain = np.array([p["MPC_XY_P"], p["MPC_XY_P"], p["MPC_Z_P"]])
        out = np.nan_to_num(gain * (self.position_enu_m - state.pos_enu_m))
        out = out + np.nan_to_num(self.velocity_enu_ms)
        speed_ms = float(np.hypot(*out[:2]))
        if speed_ms > p["MPC_XY_VEL_MAX"]:
            out[:2] *= p["MPC_XY_VEL_MAX"] / speed_ms
        out[2] = min(max(float(out[2]), -p["MPC_Z_VEL_MAX_DN"]), p["MPC_Z_VEL_MAX_UP"])
        return np.asarray(out)


def _used(enu: tuple[float, float, float], mask: int, first_bit: int) -> F64:
    """Return a vector with NaN for the axes that a type_mask ignores; its bits are north, east, down."""
    ignored = [bool(mask >> first_bit + bit & 1) for bit in (1, 0, 2)]
    return np.where(ignored, np.nan, np.array(enu, np.float64))


def _turned(velocity: F64, estimate: State) -> F64:
    """Rotate a velocity right, ahead, up into the map, by the heading alone."""
    yaw = to_euler(estimate.quat_wxyz)[2]
    right, ahead, up = (float(v) for v in velocity)
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array([ahead * sine + right * cosine, ahead * cosine - right * sine, up])
