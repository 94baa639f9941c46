"""Return to home or a rally point: RTL in stages, and SMART_RTL along the flown path."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.guidance.landing_modes import Landing
from sitl.autopilot.guidance.trajectory_shaping import velocity_towards
from sitl.vehicle.rigid_body import State

F64 = NDArray[np.float64]

AT_HEIGHT_M, AT_PLACE_M, AT_FINAL_HEIGHT_M = 0.5, 0.7, 0.2
LOWEST_M = 0.3  # RTL_ALT_MIN_M
LEAST_CONE_SLOPE = 0.5
ACCURACY_M, POINTS = 2.0, 300  # SRTL_ACCURACY's and SRTL_POINTS' defaults
ABOVE_START_M = 2.0


class Stage(Enum):
    """Stages of a return (ModeRTL::SubMode)."""

    CLIMB = auto()
    RETURN = auto()
    LOITER = auto()
    DESCENT = auto()
    LAND = auto()


class Return:
    """Controller of RTL; a landing target leads from the start of LAND only (mode_rtl.cpp).

    Attributes
    ----------
    stage
        Stage of the return.
    radio_lost
        Whether the radio failsafe is active, which lands in spite of RTL_ALT_FINAL.
    """

    def __init__(self, parameters: Mapping[str, float], landing: Landing) -> None:
        self._p, self._landing = parameters, landing
        self.stage = Stage.CLIMB
        self.radio_lost = False
        self._way: list[F64] = []
        self._loiters_since_ns = 0
        self._final_up_m = 0.0

    @property
    def is_landing(self) -> bool:
        return self.stage is Stage.LAND

    def start(self, state: State, home_enu_m: F64, rally_enu_m: Sequence[F64]) -> None:
        """Plan the way above the vehicle and to the nearest of rally points and home."""
        origin = state.pos_enu_m + state.vel_enu_ms * np.array([0.6, 0.6, 0.3])
        goal = _nearest(origin, home_enu_m, rally_enu_m, self._p)
        height_m = float(state.pos_enu_m[2] - home_enu_m[2])
        lowest_m = max(LOWEST_M, height_m + max(0.0, self._p["RTL_CLIMB_MIN"] / 100))
        up_m = max(float(goal[2] - home_enu_m[2]), self._p["RTL_ALT"] / 100, lowest_m)
        slope = self._p["RTL_CONE_SLOPE"]
        if slope >= LEAST_CONE_SLOPE:
            away_m = float(np.hypot(*(goal - origin)[:2]))
            up_m = min(up_m, max(away_m * slope, lowest_m))
        top = float(home_enu_m[2]) + max(up_m, height_m)
        self.stage = Stage.CLIMB
        self._way = [np.array([*origin[:2], top]), np.array([*goal[:2], top])]
        self._final_up_m = float(home_enu_m[2]) + self._p["RTL_ALT_FINAL"] / 100

    def move(self, jump_enu_m: F64) -> None:
        """Apply a reset of the position estimate; home and rally points are places on Earth and stay."""
        if self._way:
            self._way[0] = self._way[0] + jump_enu_m

    def velocity(self, state: State, now_ns: int, height_m: float) -> F64:
        """Return the velocity setpoint (3,) east, north, up at a height above the ground."""
        self._advance(state, now_ns)
        if self.stage is Stage.LAND:
            return self._landing.velocity(state, now_ns, height_m)
        return velocity_towards(self._goal(), state, self._p)

    @property
    def _loiter_ns(self) -> float:
        return self._p["RTL_LOIT_TIME"] * 1e6

    def _goal(self) -> F64:
        if self.stage is Stage.DESCENT:
            return np.array([*self._way[1][:2], self._final_up_m])
        return self._way[0 if self.stage is Stage.CLIMB else 1]

    def _advance(self, state: State, now_ns: int) -> None:
        """Begin the next stage at the end of one."""
        off = self._goal() - state.pos_enu_m
        if self.stage is Stage.CLIMB and off[2] < AT_HEIGHT_M:
            self.stage = Stage.RETURN
        elif self.stage is Stage.RETURN and float(np.hypot(*off[:2])) < AT_PLACE_M:
            self.stage, self._loiters_since_ns = Stage.LOITER, now_ns
        elif self.stage is Stage.LOITER and now_ns - self._loiters_since_ns >= self._loiter_ns:
            self._end_flight(state)

    def _end_flight(self, state: State) -> None:
        """Land, or sink to RTL_ALT_FINAL and stay there."""
        if self._p["RTL_ALT_FINAL"] > 0 and not self.radio_lost:
            self.stage = Stage.DESCENT
        else:
            self._landing.start(state, self._goal())
            self.stage = Stage.LAND


class PathReturn(Return):
    """Controller of SMART_RTL: back along the flown path to 2 m above its start (mode_smart_rtl.cpp)."""

    def __init__(self, parameters: Mapping[str, float], landing: Landing) -> None:
        super().__init__(parameters, landing)
        self._path: list[F64] = []

    @property
    def is_available(self) -> bool:
        """True if a path is stored."""
        return bool(self._path)

    def begin_path(self, place_enu_m: F64) -> None:
        """Discard the path, and store its start."""
        self._path = [place_enu_m.copy()]

    def store(self, place_enu_m: F64) -> None:
        """Store the vehicle's place if it is 2 m from the last one; cut off a loop that it closes."""
        if not self._path or math.dist(self._path[-1], place_enu_m) < ACCURACY_M:
            return
        near = [at for at, place in enumerate(self._path) if math.dist(place, place_enu_m) < ACCURACY_M]
        self._path = self._path[: near[0] + 1] if near else [*self._path, place_enu_m.copy()]
        if len(self._path) > POINTS:
            self._path = []

    def start(self, state: State, home_enu_m: F64, rally_enu_m: Sequence[F64]) -> None:
        """Plan the way back along the path."""
        self.stage = Stage.RETURN
        self._way = _simplified(self._path)[::-1]
        self._way[-1] = self._way[-1] + np.array([0.0, 0.0, ABOVE_START_M])
        self._final_up_m = float(home_enu_m[2]) + self._p["RTL_ALT_FINAL"] / 100

    def move(self, jump_enu_m: F64) -> None:
        """Apply a reset of the position estimate."""
        self._path = [place + jump_enu_m for place in self._path]
        self._way = [place + jump_enu_m for place in self._way]

    def _goal(self) -> F64:
        place = self._way[0]
        return np.array([*place[:2], self._final_up_m]) if self.stage is Stage.DESCENT else place

    def _advance(self, state: State, now_ns: int) -> None:
        away_m = float(np.sqrt(np.sum(np.square(self._goal() - state.pos_enu_m))))
        if self.stage is Stage.RETURN and away_m < AT_PLACE_M:
            if len(self._way) > 1:
                del self._way[0]
            else:
                self._end_flight(state)


def _nearest(
    place_enu_m: F64, home_enu_m: F64, rally_enu_m: Sequence[F64], parameters: Mapping[str, float]
) -> F64:
    """Return the nearest of rally points and home; rally points beyond RALLY_LIMIT_KM are ignored."""
    away_m = [float(np.hypot(*(point - place_enu_m)[:2])) for point in rally_enu_m]
    limit_m = parameters["RALLY_LIMIT_KM"] * 1000
    if not away_m or 0 < limit_m < min(away_m):
        return home_enu_m
    home_away_m = float(np.hypot(*(home_enu_m - place_enu_m)[:2]))
    if parameters["RALLY_INCL_HOME"] and home_away_m <= min(away_m):
        return home_enu_m
    return rally_enu_m[int(np.argmin(away_m))]


def _simplified(path: list[F64]) -> list[F64]:
    """Return a path without the points within half its accuracy of a straight line (Douglas and Peucker)."""
    if len(path) < 3:
        return list(path)
    places = np.array(path)
    line = places[-1] - places[0]
    along = (places - places[0]) @ line / max(1e-9, float(line @ line))
    off_m = np.sqrt(np.sum(np.square(places - places[0] - np.clip(along, 0, 1)[:, None] * line), axis=1))
    farthest = int(np.argmax(off_m))
    if off_m[farthest] < ACCURACY_M / 2:
        return [path[0], path[-1]]
    return [*_simplified(path[: farthest + 1])[:-1], *_simplified(path[farthest:])]
