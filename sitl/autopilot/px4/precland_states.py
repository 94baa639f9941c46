"""Precision landing of PX4: its target and its states (navigator/precland.cpp).

The target is LANDING_TARGET in MAV_FRAME_LOCAL_NED with position_valid, every other frame is refused with a
text for each message (MavlinkReceiver::handle_message_landing_target). There is no filter: the newest counts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum, auto
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.px4.position_setpoint import PositionSetpoint, SetpointType
from sitl.vehicle.rigid_body import State

F64 = NDArray[np.float64]

SETTLE_NS, LOOK_NS, ACQUIRED_NS = 2_000_000_000, 2_000_000_000, 1_000_000_000
NEVER_NS = -(1 << 62)
LATE_NS = 500_000_000  # age of a target that ends the descent near the ground
FIRST_STEP_S = 0.05


@dataclass(slots=True)
class TargetPose:
    """Newest target: its place (3,), its stamp on the autopilot's clock, and how many have come."""

    place_enu_m: F64
    stamp_ns: int
    count: int = 0


class PreclandMode(IntEnum):
    """Modes by the number of land_precision: land in place without a target, or search for one."""

    OPPORTUNISTIC = 1
    REQUIRED = 2


class PreclandState(Enum):
    """States (PrecLandState)."""

    START = auto()
    HORIZONTAL_APPROACH = auto()
    DESCEND_ABOVE_TARGET = auto()
    FINAL_APPROACH = auto()
    SEARCH = auto()
    FALLBACK = auto()
    DONE = auto()


class Precland:
    """Precision landing, which moves the navigator's setpoint.

    Attributes
    ----------
    state
        Current state.
    origin_up_m
        Height of the local frame's origin, above which PLD_SRCH_ALT counts; None before an estimate.
    """

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._p = parameters
        self._newest = TargetPose(np.zeros(3), NEVER_NS)
        self.state = PreclandState.DONE
        self.origin_up_m: float | None = None
        self._mode = PreclandMode.OPPORTUNISTIC
        self._is_new = False
        self._seen_count = self._searches = 0
        self._since_ns = 0
        self._reached_ns: int | None = None
        self._acquired_ns: int | None = None
        self._approach_up_m = 0.0
        self._slew = SetpointSlew(parameters)

    @property
    def target(self) -> TargetPose | None:
        """Newest target, None before the first."""
        return self._newest if self._newest.count else None

    def receive(self, message: Any, stamp_ns: int) -> str | None:
        """Process a LANDING_TARGET; return the text of a refusal."""
        if not message.position_valid:
            return None  # angles, for an estimator that does not run by default
        if message.frame != mavlink.MAV_FRAME_LOCAL_NED:
            return f"Landing target: coordinate frame {message.frame} unsupported\t"
        place = np.array([message.y, message.x, -message.z], np.float64)
        self._newest = TargetPose(place, stamp_ns, self._newest.count + 1)
        return None

    # ---- states -------------------------------------------------------------------------------------

    def start(self, mode: PreclandMode, setpoint: PositionSetpoint, now_ns: int) -> None:
        """Begin a precision landing (on_activation)."""
        self._mode, self._searches = mode, 0
        self._slew.restart()
        self._enter_start(setpoint, now_ns)

    def step(self, setpoint: PositionSetpoint, state: State, now_ns: int) -> None:
        """Move the setpoint, and change the state (on_active)."""
        count = self._newest.count
        self._is_new, self._seen_count = count != self._seen_count, count
        match self.state:
            case PreclandState.START:
                self._run_start(setpoint, state, now_ns)
            case PreclandState.HORIZONTAL_APPROACH:
                self._run_approach(setpoint, state, now_ns)
            case PreclandState.DESCEND_ABOVE_TARGET:
                self._run_descent(setpoint, state, now_ns)
            case PreclandState.SEARCH:
                self._run_search(setpoint, state, now_ns)

    def _run_start(self, setpoint: PositionSetpoint, state: State, now_ns: int) -> None:
        if self._enter_approach(state, now_ns):
            return
        if self._mode is PreclandMode.OPPORTUNISTIC:
            self._enter_fallback(setpoint, state, now_ns)
            return
        if float(np.hypot(*(setpoint.place_enu_m - state.pos_enu_m)[:2])) >= self._p["NAV_ACC_RAD"]:
            return
        self._reached_ns = now_ns if self._reached_ns is None else self._reached_ns
        if self._p["PLD_SRCH_TOUT"] <= 0:
            self._enter_fallback(setpoint, state, now_ns)
        elif now_ns - self._reached_ns > LOOK_NS:
            self._enter_search(setpoint, now_ns)

    def _run_approach(self, setpoint: PositionSetpoint, state: State, now_ns: int) -> None:
        """Fly level to the target; one that is lost on the way is flown to all the same."""
        target, above = self._newest, self._is_above(state)
        if above and not self._is_valid(now_ns):
            self._lose(setpoint, state, now_ns)
            return
        if above and self._is_new:
            self._reached_ns = now_ns if self._reached_ns is None else self._reached_ns
            if now_ns - self._reached_ns > SETTLE_NS:
                self._enter(PreclandState.DESCEND_ABOVE_TARGET, now_ns)
                return
        east, north = self._slew.towards(target.place_enu_m, setpoint.place_enu_m, state, now_ns)
        setpoint.hold(np.array([east, north, self._approach_up_m]))
        setpoint.type = SetpointType.POSITION

    def _run_descent(self, setpoint: PositionSetpoint, state: State, now_ns: int) -> None:
        """Sink over the target, whatever its distance; without one, land at the end or begin again."""
        target, low = self._newest, self._is_low(state, now_ns)
        seen = now_ns - target.stamp_ns < LATE_NS if low else self._is_valid(now_ns)
        if seen:
            setpoint.move_over(target.place_enu_m)
            setpoint.type = SetpointType.LAND
        elif low:
            self._enter(PreclandState.FINAL_APPROACH, now_ns)
        else:
            self._lose(setpoint, state, now_ns)

    def _run_search(self, setpoint: PositionSetpoint, state: State, now_ns: int) -> None:
        if self._is_new and self._is_valid(now_ns) and self._acquired_ns is None:
            self._acquired_ns = now_ns
            up_m = min(float(state.pos_enu_m[2]) + 1.0, float(setpoint.place_enu_m[2]))
            setpoint.hold(np.array([*setpoint.place_enu_m[:2], up_m]))
        settled = self._acquired_ns is not None and now_ns - self._acquired_ns > ACQUIRED_NS
        if settled and self._enter_approach(state, now_ns):
            return
        if now_ns - self._since_ns > self._p["PLD_SRCH_TOUT"] * 1e9:
            self._enter_fallback(setpoint, state, now_ns)

    # ---- changes of the state -------------------------------------------------------------------------

    def _enter(self, state: PreclandState, now_ns: int) -> None:
        self.state, self._since_ns = state, now_ns

    def _enter_start(self, setpoint: PositionSetpoint, now_ns: int) -> bool:
        """Begin to look for a target, unless it was done too often."""
        if self._searches > self._p["PLD_MAX_SRCH"]:
            return False
        setpoint.type = SetpointType.POSITION
        self._searches += 1
        self._reached_ns = None
        self._enter(PreclandState.START, now_ns)
        return True

    def _enter_approach(self, state: State, now_ns: int) -> bool:
        if not (self._is_new and self._is_valid(now_ns)):
            return False
        self._approach_up_m, self._reached_ns = float(state.pos_enu_m[2]), None
        self._enter(PreclandState.HORIZONTAL_APPROACH, now_ns)
        return True

    def _enter_search(self, setpoint: PositionSetpoint, now_ns: int) -> None:
        """Fly to the height of the search, from above it downwards."""
        up_m = (self.origin_up_m or 0.0) + self._p["PLD_SRCH_ALT"]
        setpoint.hold(np.array([*setpoint.place_enu_m[:2], up_m]))
        setpoint.type = SetpointType.POSITION
        self._acquired_ns = None
        self._enter(PreclandState.SEARCH, now_ns)

    def _enter_fallback(self, setpoint: PositionSetpoint, state: State, now_ns: int) -> None:
        """Land in place."""
        setpoint.hold(state.pos_enu_m)
        setpoint.type = SetpointType.LAND
        self._enter(PreclandState.FALLBACK, now_ns)

    def _lose(self, setpoint: PositionSetpoint, state: State, now_ns: int) -> None:
        """Stay here and begin again, without a target."""
        setpoint.hold(state.pos_enu_m)
        if not self._enter_start(setpoint, now_ns):
            self._enter_fallback(setpoint, state, now_ns)

    # ---- conditions (check_state_conditions) ------------------------------------------------------------

    def _is_valid(self, now_ns: int) -> bool:
        return now_ns - self._newest.stamp_ns <= self._p["PLD_BTOUT"] * 1e9

    def _is_above(self, state: State) -> bool:
        off = np.abs(self._newest.place_enu_m - state.pos_enu_m)[:2]
        return bool((off < self._p["PLD_HACC_RAD"]).all())

    def _is_low(self, state: State, now_ns: int) -> bool:
        """Return whether the height above the target permits the final approach."""
        height_m = float(state.pos_enu_m[2] - self._newest.place_enu_m[2])
        return self._is_valid(now_ns) and height_m < self._p["PLD_FAPPR_ALT"]


class SetpointSlew:
    """Limits of speed and acceleration for the setpoint of the approach (PrecLand::slewrate).

    Places are complex numbers, east + north i.
    """

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._p = parameters
        self._last_ns: int | None = None
        self._last = self._before = 0j

    def restart(self) -> None:
        """Begin at the next setpoint."""
        self._last_ns = None

    def towards(self, goal_enu_m: F64, place_enu_m: F64, state: State, now_ns: int) -> tuple[float, float]:
        """Return the setpoint (east, north) on its way from the present one to a goal."""
        dt_s = FIRST_STEP_S
        if self._last_ns is None:
            self._last = complex(*place_enu_m[:2].tolist())
            self._before = self._last - complex(*state.vel_enu_ms[:2].tolist()) * dt_s
        else:
            dt_s = (now_ns - self._last_ns) * 1e-9
        self._last_ns = now_ns
        most, goal = self._p["MPC_ACC_HOR"], complex(*goal_enu_m[:2].tolist())
        velocity = _shortened((goal - self._last) / dt_s, self._p["MPC_XY_CRUISE"])
        change = velocity - (self._last - self._before) / dt_s
        velocity += _shortened(change, most * dt_s) - change
        velocity = _shortened(velocity, math.sqrt(most * abs(self._last - goal)))
        self._before, self._last = self._last, self._last + velocity * dt_s
        return self._last.real, self._last.imag


def _shortened(vector: complex, longest: float) -> complex:
    length = abs(vector)
    return vector if length <= longest else vector * (longest / length)
