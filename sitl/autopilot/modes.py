"""Flight modes and the velocity setpoint that each commands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.guidance.landing_modes import Landing
from sitl.autopilot.guidance.mission_mode import MissionFlight
from sitl.autopilot.guidance.precland import PrecisionLanding
from sitl.autopilot.guidance.return_modes import PathReturn, Return
from sitl.autopilot.guidance.trajectory_shaping import velocity_towards
from sitl.autopilot.radio_receiver import RESTING, Sticks
from sitl.vehicle.rigid_body import State, to_euler

F64 = NDArray[np.float64]


class Mode(IntEnum):
    """Flight modes with ArduCopter's custom_mode numbers."""

    STABILIZE = 0
    ALT_HOLD = 2
    AUTO = 3
    GUIDED = 4
    LOITER = 5
    RTL = 6
    LAND = 9
    BRAKE = 17
    SMART_RTL = 21


NEEDS_POSITION = (Mode.AUTO, Mode.GUIDED, Mode.LOITER, Mode.RTL, Mode.BRAKE, Mode.SMART_RTL)
PILOTED = (Mode.LOITER, Mode.ALT_HOLD, Mode.LAND)
"""Modes in which the sticks have an effect."""
AUTONOMOUS = (Mode.AUTO, Mode.GUIDED, Mode.RTL, Mode.LAND, Mode.SMART_RTL)
"""Modes that no pilot flies (Mode::is_autopilot)."""


@dataclass(slots=True)
class GuidedTarget:
    """Last GUIDED target: a position, a velocity, or both, and a heading or turn rate."""

    position_enu_m: F64 | None = None
    velocity_enu_ms: F64 | None = None
    yaw_rad: float | None = None
    yaw_rate_rad_s: float | None = None
    stamp_ns: int = 0
    entered: bool = False
    """True if it holds the place where GUIDED was entered, which ArduCopter reports as zero velocity."""


class Navigator:
    """Guidance: velocity setpoint by mode.

    Attributes
    ----------
    home_enu_m, rally_enu_m, hold_enu_m
        Places (3,) of home, of the rally points, and where a mode without a target holds.
    guided, takeoff_up_m
        Target of GUIDED, and the height of its take-off in progress.
    radio_lost
        Whether the radio failsafe is active, in which a return lands in spite of RTL_ALT_FINAL.
    landing, returning, path_return, mission
        Controllers of LAND and of every other landing, of RTL, SMART_RTL and AUTO.
    """

    def __init__(self, parameters: Mapping[str, float], precland: PrecisionLanding) -> None:
        self.parameters = parameters
        self.home_enu_m, self.hold_enu_m = np.zeros(3), np.zeros(3)
        self.rally_enu_m: list[F64] = []
        self.guided = GuidedTarget()
        self.takeoff_up_m: float | None = None
        self.sticks: Sticks = RESTING
        self.landing = Landing(parameters, precland)
        self.returning = Return(parameters, self.landing)
        self.path_return = PathReturn(parameters, self.landing)
        self.mission = MissionFlight(parameters, self.landing, self.returning)
        self.radio_lost = False

    @property
    def repositioned(self) -> bool:
        """True if the pilot moved this landing: its target is not followed."""
        return self.landing.repositioned

    @property
    def blind(self) -> bool:
        """True if this landing has no position."""
        return self.landing.blind

    def is_landing(self, mode: IntEnum) -> bool:
        """Return whether a mode lands now (Mode::is_landing)."""
        if mode in (Mode.RTL, Mode.SMART_RTL):
            return (self.returning if mode is Mode.RTL else self.path_return).is_landing
        return mode is Mode.LAND or (mode is Mode.AUTO and self.mission.is_landing)

    def is_taking_off(self, mode: IntEnum) -> bool:
        """Return whether a mode takes off now."""
        return self.takeoff_up_m is not None or (mode is Mode.AUTO and self.mission.takeoff_up_m is not None)

    def enter(self, mode: IntEnum, state: State) -> None:
        """Start a mode from the vehicle's current state."""
        stop = state.vel_enu_ms * np.array([0.6, 0.6, 0.3])
        self.hold_enu_m = state.pos_enu_m + stop
        self.guided = GuidedTarget(position_enu_m=self.hold_enu_m.copy(), entered=True)
        self.takeoff_up_m = None
        self.landing.prepare()
        if mode is Mode.LAND:
            self.landing.start(state)
        elif mode is Mode.RTL:
            self.returning.start(state, self.home_enu_m, self.rally_enu_m)
        elif mode is Mode.SMART_RTL:
            self.path_return.start(state, self.home_enu_m, self.rally_enu_m)
        elif mode is Mode.AUTO:
            self.mission.start(state, self.home_enu_m, self.rally_enu_m)

    def move(self, jump_enu_m: F64) -> None:
        """Apply a reset of the position estimate; home and rally points are places on Earth and stay."""
        self.hold_enu_m = self.hold_enu_m + jump_enu_m
        if self.guided.position_enu_m is not None:
            self.guided.position_enu_m = self.guided.position_enu_m + jump_enu_m
        for controller in (self.landing, self.returning, self.path_return, self.mission):
            controller.move(jump_enu_m)

    def feedforward_enu_ms2(self, mode: IntEnum) -> F64 | None:
        """Return the acceleration (3,) of a setpoint that moves within limits; None if it jumps."""
        return self.landing.acceleration_enu_ms2 if self.is_landing(mode) else None

    def velocity(self, mode: IntEnum, state: State, now_ns: int, rangefinder_m: float | None) -> F64:
        """Return the velocity setpoint (3,) east, north, up; `rangefinder_m` is None if unhealthy."""
        up_m = float(state.pos_enu_m[2] - self.home_enu_m[2])
        height_m = up_m if rangefinder_m is None else rangefinder_m
        self.landing.sticks = self.sticks
        self.returning.radio_lost = self.path_return.radio_lost = self.radio_lost
        if mode is not Mode.SMART_RTL:
            self.path_return.store(state.pos_enu_m)
        if self.takeoff_up_m is not None:
            return self._take_off(state)
        if mode is Mode.GUIDED:
            return self._guided(state, now_ns)
        if mode is Mode.LAND:
            return self.landing.velocity(state, now_ns, height_m)
        if mode is Mode.RTL:
            return self.returning.velocity(state, now_ns, height_m)
        if mode is Mode.SMART_RTL:
            return self.path_return.velocity(state, now_ns, height_m)
        if mode is Mode.AUTO:
            return self.mission.velocity(state, now_ns, height_m)
        if mode in PILOTED and self.sticks is not RESTING:
            return self._steer(state)
        return velocity_towards(self.hold_enu_m, state, self.parameters)

    def _steer(self, state: State) -> F64:
        """Fly with the sticks; a centred axis holds its position: the point where the vehicle will stop."""
        p = self.parameters
        out = velocity_towards(self.hold_enu_m, state, p)
        level_ms, most_ms2 = float(np.hypot(*state.vel_enu_ms[:2])), p["WPNAV_ACCEL"] / 100
        braking_s = max(0.6, level_ms / (2 * most_ms2))
        stop = state.pos_enu_m + braking_s * state.vel_enu_ms
        if self.sticks.steering:
            yaw = to_euler(state.quat_wxyz)[2]
            ahead, right = np.array([np.sin(yaw), np.cos(yaw)]), np.array([np.cos(yaw), -np.sin(yaw)])
            out[:2] = p["LOIT_SPEED"] / 100 * (self.sticks.forward * ahead + self.sticks.right * right)
            self.hold_enu_m = np.array([stop[0], stop[1], self.hold_enu_m[2]])
        if self.sticks.up:
            out[2] = p["PILOT_SPEED_UP"] / 100 * self.sticks.up
            self.hold_enu_m = np.array([*self.hold_enu_m[:2], stop[2]])
        return out

    def _take_off(self, state: State) -> F64:
        up = self.takeoff_up_m or 0.0
        if state.pos_enu_m[2] > up - 0.3:
            self.takeoff_up_m = None
            self.guided = GuidedTarget(position_enu_m=np.array([*self.hold_enu_m[:2], up]))
        return velocity_towards(np.array([*self.hold_enu_m[:2], up]), state, self.parameters)

    def _guided(self, state: State, now_ns: int) -> F64:
        g = self.guided
        if g.velocity_enu_ms is None:
            place = self.hold_enu_m if g.position_enu_m is None else g.position_enu_m
            return velocity_towards(place, state, self.parameters)
        if now_ns - g.stamp_ns > self.parameters["GUID_TIMEOUT"] * 1e9:
            return np.zeros(3)
        wanted = g.velocity_enu_ms.copy()
        if g.position_enu_m is not None:
            wanted = wanted + velocity_towards(g.position_enu_m, state, self.parameters)
        return wanted
