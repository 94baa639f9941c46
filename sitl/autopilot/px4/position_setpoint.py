"""Setpoint of the navigator (position_setpoint_triplet), and its flight (FlightTaskAuto.cpp)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.guidance.landing_modes import STEP_S
from sitl.autopilot.guidance.trajectory_shaping import HorizontalSetpoint, vertical_towards
from sitl.autopilot.px4.px4_parameters import SharedLimits
from sitl.vehicle.rigid_body import State

F64 = NDArray[np.float64]

REACTION_S = 0.6  # from the setpoint to the vehicle's braking


class SetpointType(Enum):
    """Types of a setpoint; EXTENDED_SYS_STATE reports LANDING for the type LAND alone."""

    POSITION = auto()
    TAKEOFF = auto()
    LAND = auto()


@dataclass(slots=True)
class PositionSetpoint:
    """Current setpoint: a place (3,), and how it is flown to. A landing sinks whatever the height says."""

    place_enu_m: F64
    type: SetpointType = SetpointType.POSITION

    def move_over(self, place_enu_m: F64) -> None:
        """Move to above or below a place, at the same height."""
        self.place_enu_m = np.array([*place_enu_m[:2], self.place_enu_m[2]])

    def hold(self, place_enu_m: F64) -> None:
        """Move to a place, at its height."""
        self.place_enu_m = place_enu_m.copy()


def stop_place(state: State, parameters: Mapping[str, float]) -> F64:
    """Return where (3,) a vehicle stops that brakes now (Navigator::preproject_stop_point)."""
    speed_ms = float(np.hypot(*state.vel_enu_ms[:2]))
    braking_s = speed_ms / (2 * parameters["MPC_ACC_HOR"]) + REACTION_S
    return np.asarray(state.pos_enu_m + state.vel_enu_ms * np.array([braking_s, braking_s, 0.0]))


class AutoFlight:
    """Controller of the automatic modes.

    Attributes
    ----------
    acceleration_enu_ms2
        Acceleration (3,) of the smoothed setpoint, a feedforward.
    """

    def __init__(self, parameters: Mapping[str, float], limits: SharedLimits) -> None:
        self._p, self._limits = parameters, limits
        self._level = HorizontalSetpoint()
        self._climb_ms = 0.0

    def reset(self, state: State) -> None:
        """Begin at the vehicle's place and velocity."""
        self._level.reset(state)
        self._climb_ms = float(state.vel_enu_ms[2])

    def move(self, jump_enu_m: F64) -> None:
        """Apply a reset of the position estimate."""
        self._level.move(jump_enu_m)

    @property
    def acceleration_enu_ms2(self) -> F64:
        return np.array([self._level.acceleration.real, self._level.acceleration.imag, 0.0])

    def velocity(self, setpoint: PositionSetpoint, state: State, ground_m: float, is_ranged: bool) -> F64:
        """Return the velocity setpoint (3,) east, north, up.

        Parameters
        ----------
        ground_m
            Distance to the ground, or the height above home without a rangefinder.
        is_ranged
            Whether a rangefinder measures it.
        """
        p, up_m = self._p, float(setpoint.place_enu_m[2] - state.pos_enu_m[2])
        self._level.move_to(setpoint.place_enu_m, self._limits, STEP_S)
        climb_ms = vertical_towards(up_m, self._limits)
        if setpoint.type is SetpointType.LAND:
            climb_ms = -self._sink_ms(ground_m, is_ranged)
        elif setpoint.type is SetpointType.TAKEOFF:
            slow, fast = p["MPC_TKO_SPEED"], p["MPC_Z_V_AUTO_UP"]
            climb_ms = min(climb_ms, _between(ground_m, p["MPC_LAND_ALT2"], p["MPC_LAND_ALT1"], slow, fast))
        change = climb_ms - self._climb_ms
        most = p["MPC_ACC_UP_MAX" if change > 0 else "MPC_ACC_DOWN_MAX"] * STEP_S
        self._climb_ms += max(-most, min(most, change))
        level = self._level.followed_by(state)
        return np.array([level.real, level.imag, self._climb_ms])

    def _sink_ms(self, ground_m: float, is_ranged: bool) -> float:
        """Return the sink rate of a landing (FlightTaskAuto::_prepareLandSetpoints)."""
        p = self._p
        if is_ranged and ground_m <= p["MPC_LAND_ALT3"]:
            return p["MPC_LAND_CRWL"]
        slow, fast = p["MPC_LAND_SPEED"], p["MPC_Z_VEL_MAX_DN"]
        return _between(ground_m, p["MPC_LAND_ALT2"], p["MPC_LAND_ALT1"], slow, fast)


def _between(value: float, low: float, high: float, at_low: float, at_high: float) -> float:
    return float(np.interp(value, [low, max(low + 1e-6, high)], [at_low, at_high]))
