"""Navigator of PX4: the setpoint of each mode, and the velocity to it."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.guidance.precland import PrecisionLanding
from sitl.autopilot.guidance.trajectory_shaping import velocity_towards
from sitl.autopilot.modes import Navigator
from sitl.autopilot.px4.direct_return import DirectReturn
from sitl.autopilot.px4.offboard_control import OffboardControl
from sitl.autopilot.px4.position_setpoint import AutoFlight, PositionSetpoint, SetpointType, stop_place
from sitl.autopilot.px4.precland_states import Precland, PreclandMode
from sitl.autopilot.px4.px4_modes import AUTO, Px4Mode
from sitl.autopilot.px4.px4_parameters import SharedLimits
from sitl.autopilot.radio_receiver import RESTING
from sitl.vehicle.rigid_body import State

F64 = NDArray[np.float64]

STEP_NS = 50_000_000  # period of the navigator
STICK_UP = 0.15
STICKLESS_MS = 0.7  # PX4 1.17 sank from 20.4 to 12.8 m in 11 s of Position mode without a transmitter


class Px4Navigator(Navigator):
    """Guidance of PX4's modes; the sticks fly as ArduCopter's LOITER, with PX4's speeds.

    Attributes
    ----------
    setpoint
        Current setpoint of the automatic modes; None in others.
    precland, offboard, direct_return
        Controllers of precision landings, OFFBOARD and AUTO.RTL.
    takeoff_alt_m
        Height of the next take-off, None for MIS_TAKEOFF_ALT above the vehicle.
    reposition_enu_m
        Place (3,) of a DO_REPOSITION for the next AUTO.LOITER.
    is_blind
        Whether AUTO.LAND is a descent without a position.
    took_off
        Whether AUTO.TAKEOFF has reached its height.
    """

    def __init__(self, parameters: dict[str, float]) -> None:
        limits = SharedLimits(parameters)
        super().__init__(limits, PrecisionLanding())
        self._p = parameters
        self.setpoint: PositionSetpoint | None = None
        self.precland = Precland(parameters)
        self.offboard = OffboardControl(parameters)
        self.direct_return = DirectReturn(parameters, self.precland)
        self.takeoff_alt_m: float | None = None
        self.reposition_enu_m: F64 | None = None
        self.is_blind = self.took_off = False
        self._auto = AutoFlight(parameters, limits)
        self._mode: IntEnum = Px4Mode.MANUAL
        self._next_step_ns = 0

    @property
    def blind(self) -> bool:
        return self.is_blind

    def is_landing(self, mode: IntEnum) -> bool:
        """Return whether the setpoint is of type LAND."""
        return mode in AUTO and self.setpoint is not None and self.setpoint.type is SetpointType.LAND

    def is_taking_off(self, mode: IntEnum) -> bool:
        """Return whether a landed vehicle would leave the ground."""
        if mode is Px4Mode.OFFBOARD:
            return self.offboard.wants_up
        if mode is Px4Mode.AUTO_TAKEOFF:
            return self.setpoint is not None and self.setpoint.type is SetpointType.TAKEOFF
        return mode not in AUTO and self.sticks.up > STICK_UP

    def enter(self, mode: IntEnum, state: State) -> None:
        """Start a mode from the vehicle's current state."""
        kept = self.setpoint if self._mode is Px4Mode.AUTO_TAKEOFF and self.took_off else None
        self._mode = mode
        self.is_blind = self.took_off = False
        self.hold_enu_m = stop_place(state, self._p)
        self._auto.reset(state)
        self._next_step_ns = 0
        self.setpoint = self._first_setpoint(mode, state, kept)
        self.offboard.enter(state)

    def _first_setpoint(
        self, mode: IntEnum, state: State, kept: PositionSetpoint | None
    ) -> PositionSetpoint | None:
        here = state.pos_enu_m
        if mode is Px4Mode.AUTO_TAKEOFF:
            default_m = float(here[2]) + self._p["MIS_TAKEOFF_ALT"]
            up_m = default_m if self.takeoff_alt_m is None else max(self.takeoff_alt_m, float(here[2]))
            return PositionSetpoint(np.array([*here[:2], up_m]), SetpointType.TAKEOFF)
        if mode is Px4Mode.AUTO_LOITER:
            place, self.reposition_enu_m = self.reposition_enu_m, None
            if place is None and kept is not None:
                return PositionSetpoint(kept.place_enu_m)
            return PositionSetpoint(self.hold_enu_m.copy() if place is None else place)
        if mode is Px4Mode.AUTO_LAND:
            return PositionSetpoint(self.hold_enu_m.copy(), SetpointType.LAND)
        if mode in (Px4Mode.AUTO_PRECLAND, Px4Mode.AUTO_RTL):
            return PositionSetpoint(here.copy())  # begins with the navigator's next step
        return None

    def hold_place(self, state: State) -> F64:
        """Return where (3,) the vehicle can stop."""
        return stop_place(state, self._p)

    def reposition(self, place_enu_m: F64) -> None:
        """Set the place of the next AUTO.LOITER, or of the present one."""
        self.reposition_enu_m = place_enu_m
        if self._mode is Px4Mode.AUTO_LOITER and self.setpoint is not None:
            self.setpoint, self.reposition_enu_m = PositionSetpoint(place_enu_m), None

    def note_origin(self, state: State) -> None:
        """Keep the height of the first estimate: the origin of PX4's local frame."""
        if self.precland.origin_up_m is None:
            self.precland.origin_up_m = float(state.pos_enu_m[2])

    def move(self, jump_enu_m: F64) -> None:
        """Apply a reset of the position estimate."""
        self.hold_enu_m = self.hold_enu_m + jump_enu_m
        if self.setpoint is not None:
            self.setpoint.place_enu_m = self.setpoint.place_enu_m + jump_enu_m
        self._auto.move(jump_enu_m)

    def step(self, mode: IntEnum, state: State, now_ns: int) -> None:
        """Run the automatic mode once in 50 ms (Navigator::run)."""
        if now_ns < self._next_step_ns or self.setpoint is None:
            return
        begins, self._next_step_ns = self._next_step_ns == 0, now_ns + STEP_NS
        if mode is Px4Mode.AUTO_RTL:
            if begins:
                self.setpoint = self.direct_return.start(state, self.home_enu_m, self.rally_enu_m, now_ns)
            self.direct_return.step(self.setpoint, state, now_ns)
        elif mode is Px4Mode.AUTO_PRECLAND:
            if begins:
                self.precland.start(PreclandMode.REQUIRED, self.setpoint, now_ns)
            self.precland.step(self.setpoint, state, now_ns)
        elif mode is Px4Mode.AUTO_TAKEOFF and not self.took_off:
            left_m = float(self.setpoint.place_enu_m[2] - state.pos_enu_m[2])
            if left_m < self._p["NAV_MC_ALT_RAD"]:  # Takeoff::on_active
                self.took_off, self.setpoint.type = True, SetpointType.POSITION

    def feedforward_enu_ms2(self, mode: IntEnum) -> F64 | None:
        """Return the acceleration (3,) of the smoothed setpoint; OFFBOARD's jumps as it is sent."""
        if mode is Px4Mode.OFFBOARD:
            return np.zeros(3)
        return self._auto.acceleration_enu_ms2 if self.setpoint is not None else None

    def velocity(self, mode: IntEnum, state: State, now_ns: int, rangefinder_m: float | None) -> F64:
        """Return the velocity setpoint (3,) east, north, up; `rangefinder_m` is None if unhealthy."""
        self.step(mode, state, now_ns)
        if mode is Px4Mode.OFFBOARD:
            return self.offboard.velocity(state)
        if self.setpoint is not None:
            above_home_m = float(state.pos_enu_m[2] - self.home_enu_m[2])
            ground_m = above_home_m if rangefinder_m is None else rangefinder_m
            return self._auto.velocity(self.setpoint, state, ground_m, rangefinder_m is not None)
        if self.sticks is not RESTING:
            return self._steer(state)
        out = velocity_towards(self.hold_enu_m, state, self.parameters)
        out[2] = -STICKLESS_MS if self.radio_lost else out[2]
        return out

    def course_rad(self, mode: IntEnum, state: State) -> float | None:
        """Return the heading along the way, clockwise from north (MPC_YAW_MODE 0); None keeps the heading."""
        if mode is not Px4Mode.AUTO_RTL or not self.direct_return.is_on_the_way or self.setpoint is None:
            return None
        off = self.setpoint.place_enu_m - state.pos_enu_m
        far = float(np.hypot(*off[:2])) > self._p["RTL_MIN_DIST"]
        return float(np.arctan2(off[0], off[1])) if far else None
