"""Flight of a mission: AUTO with take-off, waypoints, landing and return (mode_auto.cpp)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.guidance.landing_modes import Landing
from sitl.autopilot.guidance.return_modes import AT_PLACE_M, Return
from sitl.autopilot.guidance.trajectory_shaping import velocity_towards
from sitl.vehicle.rigid_body import State

F64 = NDArray[np.float64]

TAKEOFF, WAYPOINT = mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_WAYPOINT
LAND, RETURN = mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
AT_TOP_M = 0.3


@dataclass(frozen=True, slots=True)
class Leg:
    """Command of a mission: its number, its place without one None, and the time to stay there."""

    command: int
    number: int
    place_enu_m: F64 | None
    hold_s: float = 0.0


class MissionFlight:
    """Controller of AUTO.

    Attributes
    ----------
    legs
        Commands of the mission, without home.
    takeoff_up_m
        Height of a take-off in progress, else None.
    """

    def __init__(self, parameters: Mapping[str, float], landing: Landing, returning: Return) -> None:
        self._p, self._landing, self._returning = parameters, landing, returning
        self.legs: Sequence[Leg] = ()
        self.takeoff_up_m: float | None = None
        self._reached: list[int] = []
        self._at = 0
        self._goal = np.zeros(3)
        self._arrived_ns: int | None = None
        self._descends = False
        self._home_and_rally: tuple[F64, Sequence[F64]] = (np.zeros(3), ())

    @property
    def current(self) -> Leg | None:
        """Command that is flown, None at the mission's end."""
        return self.legs[self._at] if self._at < len(self.legs) else None

    @property
    def is_landing(self) -> bool:
        leg = self.current
        if leg is not None and leg.command == RETURN:
            return self._returning.is_landing
        return self._descends

    def take_reached(self) -> list[int]:
        """Return the numbers of the commands that ended since the last call."""
        out, self._reached = self._reached, []
        return out

    def restart(self) -> None:
        """Begin at the first command when AUTO is next entered, as after a disarm."""
        self._at = 0

    def start(self, state: State, home_enu_m: F64, rally_enu_m: Sequence[F64]) -> None:
        """Begin or resume the mission."""
        self._at = 0 if self.current is None else self._at
        self._home_and_rally = home_enu_m, rally_enu_m
        self._begin(state)

    def move(self, jump_enu_m: F64) -> None:
        """Apply a reset of the position estimate to a place that is not of the mission."""
        if self.current is None or self.current.place_enu_m is None:
            self._goal = self._goal + jump_enu_m

    def velocity(self, state: State, now_ns: int, height_m: float) -> F64:
        """Return the velocity setpoint (3,) east, north, up at a height above the ground."""
        leg = self.current
        if leg is not None and self._is_over(leg, state, now_ns):
            self._reached.append(leg.number)
            self._at += 1
            self._begin(state)
            leg = self.current
        if leg is not None and leg.command == RETURN:
            return self._returning.velocity(state, now_ns, height_m)
        if self._descends:
            return self._landing.velocity(state, now_ns, height_m)
        return velocity_towards(self._goal, state, self._p)

    def _begin(self, state: State) -> None:
        """Begin the current command, or stay at the mission's end."""
        leg, here = self.current, state.pos_enu_m
        self.takeoff_up_m, self._arrived_ns, self._descends = None, None, False
        self._goal = here + 0.6 * state.vel_enu_ms
        if leg is None:
            return
        if leg.command == TAKEOFF and leg.place_enu_m is not None:
            self.takeoff_up_m = max(float(leg.place_enu_m[2]), float(here[2]))
            self._goal = np.array([*here[:2], self.takeoff_up_m])
        elif leg.command == RETURN:
            self._returning.start(state, *self._home_and_rally)
        elif leg.command == LAND and leg.place_enu_m is None:
            self._land(state)
        elif leg.place_enu_m is not None:
            up_m = here[2] if leg.command == LAND else leg.place_enu_m[2]
            self._goal = np.array([*leg.place_enu_m[:2], up_m])

    def _land(self, state: State) -> None:
        """Land from here; param2 of NAV_LAND is not stored (AP_Mission.cpp)."""
        self._descends = True
        self._landing.repositioned = False
        self._landing.start(state, self._goal)

    def _is_over(self, leg: Leg, state: State, now_ns: int) -> bool:
        """Return whether a command has ended; a landing and a return end with the disarm."""
        if leg.command == RETURN or self._descends:
            return False
        off = self._goal - state.pos_enu_m
        if leg.command == TAKEOFF:
            return bool(off[2] < AT_TOP_M)
        if float(np.sqrt(off @ off)) >= AT_PLACE_M and self._arrived_ns is None:
            return False
        if leg.command == LAND:
            self._land(state)
            return False
        self._arrived_ns = now_ns if self._arrived_ns is None else self._arrived_ns
        return now_ns - self._arrived_ns >= leg.hold_s * 1e9
