"""AUTO.RTL straight to home or a rally point, for a vehicle that hovers (rtl.cpp, rtl_direct.cpp)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.px4.position_setpoint import PositionSetpoint, SetpointType
from sitl.autopilot.px4.precland_states import Precland, PreclandMode
from sitl.vehicle.rigid_body import State

F64 = NDArray[np.float64]

NEARER_M = 2.0  # MIN_DIST_THRESHOLD: how much nearer than home a rally point must be
BESIDE_HOME_M = 10.0  # MAX_DIST_FROM_HOME_FOR_LAND_APPROACHES: rally points nearer to home are ignored


class ReturnState(Enum):
    """States (RtlDirect::RTLState) of a multirotor."""

    CLIMBING = auto()
    MOVE_TO_LOITER = auto()
    LOITER_DOWN = auto()
    LOITER_HOLD = auto()
    MOVE_TO_LAND_HOVER = auto()
    LAND = auto()


class DirectReturn:
    """Return that moves the navigator's setpoint; its landing follows a target with RTL_PLD_MD.

    Attributes
    ----------
    state
        Current state.
    up_m
        Height of the return.
    """

    def __init__(self, parameters: Mapping[str, float], precland: Precland) -> None:
        self._p, self._precland = parameters, precland
        self.state = ReturnState.CLIMBING
        self.up_m = 0.0
        self._goal = np.zeros(3)
        self._climb_place = np.zeros(3)
        self._since_ns = 0
        self._is_precise = False

    @property
    def is_on_the_way(self) -> bool:
        return self.state is ReturnState.MOVE_TO_LOITER

    def start(
        self, state: State, home_enu_m: F64, rally_enu_m: Sequence[F64], now_ns: int
    ) -> PositionSetpoint:
        """Choose the destination and the height; return the first setpoint."""
        self._goal = _destination(state.pos_enu_m, home_enu_m, rally_enu_m, self._p)
        self.up_m = self._height_m(state.pos_enu_m)
        self._climb_place = state.pos_enu_m.copy()
        setpoint = PositionSetpoint(state.pos_enu_m.copy())
        is_low = state.pos_enu_m[2] < self.up_m
        self._enter(ReturnState.CLIMBING if is_low else ReturnState.MOVE_TO_LOITER, setpoint, now_ns)
        return setpoint

    def step(self, setpoint: PositionSetpoint, state: State, now_ns: int) -> None:
        """Begin the next state where one is reached; lead the landing to its target (on_active)."""
        if self._is_reached(setpoint, state, now_ns):
            self._enter(self._next(), setpoint, now_ns)
        if self.state is ReturnState.LAND and self._is_precise:
            self._precland.step(setpoint, state, now_ns)

    def _next(self) -> ReturnState:
        if self.state is ReturnState.CLIMBING:
            return ReturnState.MOVE_TO_LOITER
        if self.state is ReturnState.MOVE_TO_LOITER:
            return ReturnState.LOITER_DOWN if self._p["RTL_LAND_DELAY"] else ReturnState.LAND
        order = list(ReturnState)
        return order[order.index(self.state) + 1]

    def _enter(self, state: ReturnState, setpoint: PositionSetpoint, now_ns: int) -> None:
        """Begin a state (RtlDirect::set_rtl_item)."""
        self.state, self._since_ns = state, now_ns
        if state is ReturnState.LAND:
            mode = int(self._p["RTL_PLD_MD"])
            self._is_precise = mode > 0
            if self._is_precise:
                self._precland.start(PreclandMode(mode), setpoint, now_ns)
            setpoint.hold(self._goal)
            setpoint.type = SetpointType.LAND
            return
        place = self._climb_place if state is ReturnState.CLIMBING else self._goal
        down = (ReturnState.LOITER_DOWN, ReturnState.LOITER_HOLD, ReturnState.MOVE_TO_LAND_HOVER)
        low_m = min(float(self._goal[2]) + self._p["RTL_DESCEND_ALT"], self.up_m)
        setpoint.hold(np.array([*place[:2], low_m if state in down else self.up_m]))
        setpoint.type = SetpointType.POSITION

    def _is_reached(self, setpoint: PositionSetpoint, state: State, now_ns: int) -> bool:
        """Return whether a state has ended (MissionBlock::is_mission_item_reached_or_completed)."""
        if self.state is ReturnState.LAND:
            return False
        off = setpoint.place_enu_m - state.pos_enu_m
        at_height = abs(float(off[2])) <= self._p["NAV_MC_ALT_RAD"]
        at_place = float(np.hypot(*off[:2])) < self._p["NAV_ACC_RAD"]
        if self.state is ReturnState.LOITER_HOLD:
            delay_s = self._p["RTL_LAND_DELAY"]
            return delay_s >= 0 and now_ns - self._since_ns >= delay_s * 1e9
        if self.state is ReturnState.MOVE_TO_LAND_HOVER:
            return at_place
        return at_height and (at_place or self.state is ReturnState.CLIMBING)

    def _height_m(self, place_enu_m: F64) -> float:
        """Return the height of the return (RTL::calculate_return_alt_from_cone_half_angle)."""
        p, goal_m, here_m = self._p, float(self._goal[2]), float(place_enu_m[2])
        highest_m = goal_m + p["RTL_RETURN_ALT"]
        if p["RTL_CONE_ANG"] <= 0:
            return max(here_m, highest_m)
        away_m = float(np.hypot(*(self._goal - place_enu_m)[:2]))
        if away_m <= p["NAV_ACC_RAD"]:
            up_m = goal_m + 2 * away_m
        else:
            up_m = highest_m
            if away_m <= p["RTL_MIN_DIST"]:
                angle = math.radians(min(max(p["RTL_CONE_ANG"], 1.0), 89.0))
                up_m = min(away_m / math.tan(angle) + goal_m, highest_m)
            up_m = max(up_m, goal_m + 2 * p["NAV_ACC_RAD"])
        return here_m if up_m < here_m else min(up_m, highest_m)


def _destination(
    place_enu_m: F64, home_enu_m: F64, rally_enu_m: Sequence[F64], parameters: Mapping[str, float]
) -> F64:
    """Return home or a rally point by RTL_TYPE (RTL::findRtlDestination); missions are not flown."""
    kind = int(parameters["RTL_TYPE"])
    best, best_m = home_enu_m, math.inf if kind == 1 else _away_m(home_enu_m, place_enu_m)
    for point in rally_enu_m if kind not in (2, 4) else ():
        if _away_m(point, home_enu_m) > BESIDE_HOME_M and _away_m(point, place_enu_m) + NEARER_M < best_m:
            best, best_m = point, _away_m(point, place_enu_m)
    return best.copy()


def _away_m(one: F64, other: F64) -> float:
    return float(np.hypot(*(one - other)[:2]))
