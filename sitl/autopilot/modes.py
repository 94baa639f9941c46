"""Flight modes and the velocity setpoint that each commands."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.cascade_control import approach
from sitl.autopilot.precland import PrecisionLanding
from sitl.autopilot.radio_receiver import RESTING, Sticks
from sitl.vehicle.rigid_body import State, to_euler

F64 = NDArray[np.float64]


class Mode(IntEnum):
    """Flight modes with ArduCopter's custom_mode numbers."""

    STABILIZE = 0
    ALT_HOLD = 2
    GUIDED = 4
    LOITER = 5
    RTL = 6
    LAND = 9
    BRAKE = 17


NEEDS_POSITION = (Mode.GUIDED, Mode.LOITER, Mode.RTL, Mode.BRAKE)
PILOTED = (Mode.LOITER, Mode.ALT_HOLD, Mode.LAND)
"""Modes in which the sticks have an effect."""
REPOSITION_MS = 1.35
"""Speed of land repositioning at full stick: 1 m/s at 1800 us."""
PAUSE_NS = 4_000_000_000
REPOSITION_AND_RESUME = 2


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


@dataclass(slots=True)
class Search:
    """State of a landing target's search: the vehicle's place at the last sighting, and the retries."""

    seen_enu_m: F64 | None = None
    lost_ns: int | None = None
    tries: int = 0
    returning: bool = False
    hover_enu_m: F64 | None = None

    def found(self, target_enu_m: F64, state: State) -> None:
        """Record the place at which the target is in sight."""
        self.seen_enu_m = np.array([target_enu_m[0], target_enu_m[1], state.pos_enu_m[2]])
        self.lost_ns = self.hover_enu_m = None
        self.returning = False


@dataclass(slots=True)
class Navigator:
    """Guidance: velocity setpoint by mode."""

    parameters: dict[str, float]
    precland: PrecisionLanding
    home_enu_m: F64 = field(default_factory=lambda: np.zeros(3))
    hold_enu_m: F64 = field(default_factory=lambda: np.zeros(3))
    rally_enu_m: list[F64] = field(default_factory=list)
    return_enu_m: F64 = field(default_factory=lambda: np.zeros(3))
    guided: GuidedTarget = field(default_factory=GuidedTarget)
    takeoff_up_m: float | None = None
    climbing: bool = False
    descending: bool = False
    search: Search = field(default_factory=Search)
    sticks: Sticks = RESTING
    repositioned: bool = False
    """True if the pilot moved this landing with roll or pitch: its target is abandoned."""
    blind: bool = False
    """True if this landing has no position: it flies level, or leans with roll and pitch."""
    _paused_until_ns: int = 0

    def enter(self, mode: Mode, state: State) -> None:
        """Start a mode from the vehicle's current state."""
        stop = state.vel_enu_ms * np.array([0.6, 0.6, 0.3])
        self.hold_enu_m = state.pos_enu_m + stop
        self.guided = GuidedTarget(position_enu_m=self.hold_enu_m.copy(), entered=True)
        self.takeoff_up_m = None
        self.climbing = mode is Mode.RTL
        self.descending = False
        self.search = Search()
        self.repositioned = self.blind = False
        self._paused_until_ns = 0
        if mode is Mode.RTL:
            self.return_enu_m = self._return_point(state)

    def pause(self, now_ns: int) -> None:
        """Delay the descent of a landing by four seconds, as after a failsafe."""
        self._paused_until_ns = now_ns + PAUSE_NS

    def move(self, jump_enu_m: F64) -> None:
        """Apply a reset of the position estimate; home and rally points are places on Earth and stay."""
        self.hold_enu_m = self.hold_enu_m + jump_enu_m
        if self.guided.position_enu_m is not None:
            self.guided.position_enu_m = self.guided.position_enu_m + jump_enu_m
        for name in ("seen_enu_m", "hover_enu_m"):
            place = getattr(self.search, name)
            if place is not None:
                setattr(self.search, name, place + jump_enu_m)

    def velocity(self, mode: Mode, state: State, now_ns: int, rangefinder_m: float | None) -> F64:
        """Return the velocity setpoint (3,) east, north, up; `rangefinder_m` is None if unhealthy."""
        if self.takeoff_up_m is not None:
            return self._take_off(state)
        if mode is Mode.GUIDED:
            return self._guided(state, now_ns)
        if mode is Mode.LAND:
            return self._land(state, now_ns, rangefinder_m)
        if mode is Mode.RTL:
            return self._return(state, now_ns, rangefinder_m)
        if mode in PILOTED and self.sticks is not RESTING:
            return self._steer(state)
        return self._hold(self.hold_enu_m, state)

    def _steer(self, state: State) -> F64:
        """Fly with the sticks; a centred axis holds its position."""
        p = self.parameters
        climb = p["PILOT_SPEED_UP"] / 100 * self.sticks.up
        return self._moved(state, p["LOIT_SPEED"] / 100, climb)

    def _moved(self, state: State, speed_ms: float, climb_ms: float) -> F64:
        """Return the velocity of deflected sticks, and move the hold point to where the vehicle will stop."""
        out = self._hold(self.hold_enu_m, state)
        level_ms, most_ms2 = float(np.hypot(*state.vel_enu_ms[:2])), self.parameters["WPNAV_ACCEL"] / 100
        braking_s = max(0.6, level_ms / (2 * most_ms2))
        stop = state.pos_enu_m + braking_s * state.vel_enu_ms
        if self.sticks.steering:
            yaw = to_euler(state.quat_wxyz)[2]
            ahead, right = np.array([np.sin(yaw), np.cos(yaw)]), np.array([np.cos(yaw), -np.sin(yaw)])
            out[:2] = speed_ms * (self.sticks.forward * ahead + self.sticks.right * right)
            self.hold_enu_m = np.array([stop[0], stop[1], self.hold_enu_m[2]])
        if climb_ms:
            out[2] = climb_ms
            self.hold_enu_m = np.array([*self.hold_enu_m[:2], stop[2]])
        return out

    def _hold(self, target_enu_m: F64, state: State) -> F64:
        p = self.parameters
        offset = target_enu_m - state.pos_enu_m
        out = np.zeros(3)
        out[:2] = approach(offset[:2], p["WPNAV_SPEED"] / 100, p["WPNAV_ACCEL"] / 100)
        limit = p["WPNAV_SPEED_UP"] if offset[2] > 0 else p["WPNAV_SPEED_DN"]
        out[2] = approach(offset[2], limit / 100, 1.0)
        return out

    def _take_off(self, state: State) -> F64:
        up = self.takeoff_up_m or 0.0
        if state.pos_enu_m[2] > up - 0.3:
            self.takeoff_up_m = None
            self.guided = GuidedTarget(position_enu_m=np.array([*self.hold_enu_m[:2], up]))
        return self._hold(np.array([*self.hold_enu_m[:2], up]), state)

    def _guided(self, state: State, now_ns: int) -> F64:
        g = self.guided
        if g.velocity_enu_ms is None:
            return self._hold(self.hold_enu_m if g.position_enu_m is None else g.position_enu_m, state)
        if now_ns - g.stamp_ns > self.parameters["GUID_TIMEOUT"] * 1e9:
            return np.zeros(3)
        wanted = g.velocity_enu_ms.copy()
        if g.position_enu_m is not None:
            wanted = wanted + self._hold(g.position_enu_m, state)
        return wanted

    def _land(self, state: State, now_ns: int, rangefinder_m: float | None) -> F64:
        """Descend over the precision-landing target while it is valid, else over the hold point.

        Roll or pitch moves that point, and for the rest of this landing the target is not followed.
        """
        p = self.parameters
        steered = bool(p["LAND_REPOSITION"]) and self.sticks.steering
        self.repositioned = self.repositioned or steered
        resumes = not steered and int(p["PLND_OPTIONS"]) & REPOSITION_AND_RESUME
        follows = p["PLND_ENABLED"] and not self.blind and (not self.repositioned or resumes)
        target = self.precland.target(now_ns) if follows else None
        if target is not None:
            self.search.found(target, state)
            self.hold_enu_m = np.array([target[0], target[1], state.pos_enu_m[2]])
        elif follows and (elsewhere := self._lost(state, now_ns, rangefinder_m)) is not None:
            return self._hold(elsewhere, state)
        height = state.pos_enu_m[2] - self.home_enu_m[2] if rangefinder_m is None else rangefinder_m
        out = self._moved(state, REPOSITION_MS, 0.0) if steered else self._hold(self.hold_enu_m, state)
        if now_ns < self._paused_until_ns:
            out[2] = 0.0
            return out
        low = height < p["LAND_ALT_LOW"] / 100
        speed = p["LAND_SPEED"] if low else p["LAND_SPEED_HIGH"] or p["WPNAV_SPEED_DN"]
        out[2] = -speed / 100
        if target is not None and height < 2.0:
            error = float(np.hypot(*(target[:2] - state.pos_enu_m[:2])))
            out[2] *= max(0.2, 1.0 - error)  # slower near the ground while off the target
        return out

    def _lost(self, state: State, now_ns: int, rangefinder_m: float | None) -> F64 | None:
        """Return the position that PLND_STRICT commands without a target, or None to descend.

        ArduPilot acts only while a healthy rangefinder reads between PLND_ALT_MIN and PLND_ALT_MAX; otherwise
        it descends. It waits for a target that was seen before, then searches again where it was last in
        sight.
        """
        p, search = self.parameters, self.search
        if search.returning and search.seen_enu_m is not None:
            if float(np.sqrt(np.sum(np.square(search.seen_enu_m - state.pos_enu_m)))) > 0.5:
                return search.seen_enu_m
            search.returning, search.lost_ns = False, now_ns
        in_band = rangefinder_m is not None and p["PLND_ALT_MIN"] <= rangefinder_m <= p["PLND_ALT_MAX"]
        if not in_band or p["PLND_STRICT"] < 1:
            return None
        if search.seen_enu_m is not None:
            if search.lost_ns is None:
                search.lost_ns = now_ns
            if now_ns - search.lost_ns < p["PLND_TIMEOUT"] * 1e9:
                return None
            if search.tries < p["PLND_RET_MAX"]:
                search.tries += 1
                search.returning = True
                return search.seen_enu_m
        if p["PLND_STRICT"] < 2:
            return None
        if search.hover_enu_m is None:
            search.hover_enu_m = state.pos_enu_m.copy()
        return search.hover_enu_m

    def _return(self, state: State, now_ns: int, rangefinder_m: float | None) -> F64:
        if self.descending:  # permanently: a landing target may lead away from home
            return self._land(state, now_ns, rangefinder_m)
        lowest = self.home_enu_m[2] + self.parameters["RTL_ALT"] / 100
        top = max(self.hold_enu_m[2], lowest, self.return_enu_m[2])
        if self.climbing:
            if state.pos_enu_m[2] > top - 0.5:
                self.climbing = False
            return self._hold(np.array([*self.hold_enu_m[:2], top]), state)
        there = np.array([*self.return_enu_m[:2], top])
        if float(np.hypot(*(there[:2] - state.pos_enu_m[:2]))) > 0.7:
            return self._hold(there, state)
        self.descending = True
        self.hold_enu_m = there
        return self._land(state, now_ns, rangefinder_m)

    def _return_point(self, state: State) -> F64:
        """Return the nearest of rally points and home; rally points beyond RALLY_LIMIT_KM are ignored."""
        p = self.parameters
        if not self.rally_enu_m:
            return self.home_enu_m.copy()
        off = [float(np.hypot(*(point[:2] - state.pos_enu_m[:2]))) for point in self.rally_enu_m]
        nearest = int(np.argmin(off))
        home_off = float(np.hypot(*(self.home_enu_m[:2] - state.pos_enu_m[:2])))
        too_far = 0 < p["RALLY_LIMIT_KM"] * 1000 < off[nearest]
        if too_far or (p["RALLY_INCL_HOME"] and home_off <= off[nearest]):
            return self.home_enu_m.copy()
        return self.rally_enu_m[nearest].copy()
