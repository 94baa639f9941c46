"""Landing: LAND, and the last stage of RTL, SMART_RTL and AUTO (mode.cpp, land_run_normal_or_precland)."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from sitl.autopilot.guidance.precland import PrecisionLanding
from sitl.autopilot.guidance.target_search import Action, TargetSearch
from sitl.autopilot.guidance.trajectory_shaping import (
    CLIMB_MS2,
    HorizontalSetpoint,
    braking_speed,
    vertical_towards,
)
from sitl.autopilot.radio_receiver import RESTING, Sticks
from sitl.vehicle.rigid_body import State, to_euler

F64 = NDArray[np.float64]

STEP_S = 0.01
"""Period of the outer loop."""
REPOSITION_MS = 1.35
"""Speed of land repositioning at full stick: 1 m/s at 1800 us."""
PAUSE_NS = 4_000_000_000
RESUMES, STAYS_FAST = 2, 4
"""Bits of PLND_OPTIONS: follow the target again after a stick; do not slow down near the ground."""
SLOW_FROM_M, SLOW_TO_M = 0.35, 2.0
SLOWEST_MS, GOOD_M = 0.1, 0.15


class Landing:
    """Controller of a landing.

    Attributes
    ----------
    precland
        Estimator of the target; a valid target leads, however far away.
    sticks
        Sticks of the pilot.
    repositioned
        Whether the pilot moved this landing with roll or pitch: its target is not followed, until the stick
        is released if PLND_OPTIONS has RESUMES, else for good.
    blind
        Whether this landing has no position: it flies level, or leans with roll and pitch, without a target.
    acceleration_enu_ms2
        Acceleration (3,) of the setpoint, a feedforward.
    """

    def __init__(self, parameters: Mapping[str, float], precland: PrecisionLanding) -> None:
        self._p, self.precland = parameters, precland
        self._search = TargetSearch(precland, parameters)
        self._setpoint = HorizontalSetpoint()
        self._climb_ms = 0.0
        self._since_ns: int | None = None
        self._pauses = False
        self.sticks: Sticks = RESTING
        self.repositioned = self.blind = False

    def prepare(self) -> None:
        """Begin a mode that lands at its end."""
        self._search.restart()
        self.repositioned = self.blind = self._pauses = False

    def start(self, state: State, place_enu_m: F64 | None = None) -> None:
        """Begin to land from the vehicle's place and velocity, or over a place that was held before."""
        self._setpoint.reset(state)
        if place_enu_m is not None:
            self._setpoint.hold(place_enu_m)
        self._climb_ms = float(state.vel_enu_ms[2])
        self._since_ns = None

    def pause(self) -> None:
        """Hold the height until four seconds after the start, as a failsafe's LAND does."""
        self._pauses = True

    def move(self, jump_enu_m: F64) -> None:
        """Apply a reset of the position estimate."""
        self._setpoint.move(jump_enu_m)

    def replace_precland(self, precland: PrecisionLanding) -> None:
        """Use another estimator, after a reboot."""
        self.precland = self._search.precland = precland

    @property
    def acceleration_enu_ms2(self) -> F64:
        ahead = self._setpoint.acceleration
        return np.array([ahead.real, ahead.imag, 0.0])

    def velocity(self, state: State, now_ns: int, height_m: float) -> F64:
        """Return the velocity setpoint (3,) east, north, up at a height above the ground."""
        self._since_ns = now_ns if self._since_ns is None else self._since_ns
        self._pauses = self._pauses and now_ns - self._since_ns < PAUSE_NS
        action, place = Action.HOVER if self._pauses else Action.SINK, state.pos_enu_m
        if self._p["PLND_ENABLED"] and not (self._pauses or self.blind or self.repositioned):
            action, place = self._search.act(place, now_ns)
        if action is Action.FLY:
            self.repositioned = self._is_steered()
            self._setpoint.move_to(place, self._p, STEP_S)
            climb_ms = vertical_towards(float(place[2] - state.pos_enu_m[2]), self._p)
        else:
            target = self._lead(state, now_ns)
            climb_ms = 0.0 if action is Action.HOVER else -self._sink_ms(state, height_m, target)
        change = climb_ms - self._climb_ms
        self._climb_ms += max(-CLIMB_MS2 * STEP_S, min(CLIMB_MS2 * STEP_S, change))
        level = self._setpoint.followed_by(state)
        return np.array([level.real, level.imag, self._climb_ms])

    def _is_steered(self) -> bool:
        return bool(self._p["LAND_REPOSITION"]) and self.sticks.steering

    def _lead(self, state: State, now_ns: int) -> F64 | None:
        """Move the setpoint with the sticks, to the target, or to a stop; return the target that leads.

        See land_run_horizontal_control.
        """
        if self._is_steered():
            self.repositioned = True
        elif int(self._p["PLND_OPTIONS"]) & RESUMES:
            self.repositioned = False
        follows = self._p["PLND_ENABLED"] and not (self.blind or self.repositioned)
        target = self.precland.target(now_ns) if follows else None
        if target is not None:
            self._setpoint.move_to(target, self._p, STEP_S)
            return target
        wanted = 0j
        if self._is_steered():
            yaw = to_euler(state.quat_wxyz)[2]
            ahead, right = REPOSITION_MS * self.sticks.forward, REPOSITION_MS * self.sticks.right
            east = ahead * math.sin(yaw) + right * math.cos(yaw)
            wanted = complex(east, ahead * math.cos(yaw) - right * math.sin(yaw))
        self._setpoint.move_with(wanted, self._p, STEP_S)
        return None

    def _sink_ms(self, state: State, height_m: float, target: F64 | None) -> float:
        """Return the sink rate: none while too far from the target (land_run_vertical_control)."""
        p = self._p
        slow, low_m = p["LAND_SPEED"] / 100, max(1.0, p["LAND_ALT_LOW"] / 100)
        fast = max(slow, (p["LAND_SPEED_HIGH"] or p["WPNAV_SPEED_DN"]) / 100)
        sink = min(fast, max(slow, float(braking_speed(height_m - low_m, 1.0, CLIMB_MS2))))
        if target is None:
            return sink
        off_m = float(np.hypot(*(target - state.pos_enu_m)[:2]))
        if 0 < p["PLND_XY_DIST_MAX"] < off_m:
            return 0.0
        near = SLOW_FROM_M < self.precland.measured_down_m < SLOW_TO_M
        if not near or int(p["PLND_OPTIONS"]) & STAYS_FAST:
            return sink
        return max(SLOWEST_MS, slow / 2 * (1 - off_m / GOOD_M))
