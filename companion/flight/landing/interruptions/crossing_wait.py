"""Wait over the point while somebody crosses it.

People, dogs and balls pass; vehicles may stop, so that the landing is broken off for them at once.
"""

from __future__ import annotations

from dataclasses import replace

from companion.flight.landing.interruptions.crossing import crossing, leaves_after_s, name, on_the_point
from companion.flight.landing.landing_state import SECOND, LandingState
from companion.flight.landing.situation import (
    STOPPED,
    Phase,
    Severity,
    Situation,
    VehicleCommands,
)
from slz import MovingObject

SMALL_M = 0.7  # radius of the returns of what is waited for
LEAST_HEIGHT_M = 3.0  # over the point, for a wait: lower, a vehicle over somebody's head climbs
FREE_NS = SECOND  # nobody crosses, before the landing goes on
GIVEN_BACK_NS = 6 * SECOND  # after somebody left, until which the map must show point and way in safe again
LONGEST_NS = 20 * SECOND
MARGIN_S = 1.0  # of the time told to the pilot


class CrossingWait:
    """Holds the vehicle where it is, in the descent or the autopilot's landing."""

    def __init__(self, state: LandingState) -> None:
        self._state = state
        self._since_ns: int | None = None
        self._crossed_ns = 0  # last time at which somebody was crossing
        self._asked_ns = 0

    @property
    def is_on(self) -> bool:
        """Whether the vehicle waits."""
        return self._since_ns is not None

    def reset(self) -> None:
        """End the wait."""
        self._since_ns = None

    def commands(self, s: Situation) -> VehicleCommands | None:
        """Return the commands of a wait; None where the landing goes on, or must be broken off."""
        state = self._state
        if s.now_ns - self._asked_ns > SECOND:  # another descent
            self.reset()
        self._asked_ns = s.now_ns
        low = state.aim.height_left_m < LEAST_HEIGHT_M
        if low or not s.lidar_ok or state.is_urgent or state.is_battery_low(s) or state.path is not None:
            self.reset()
            return None
        one = self._crosser(s)
        if one is not None and self._since_ns is None:
            self._since_ns = s.now_ns
            seconds = leaves_after_s(one, s, state.aim, state.parameters) + MARGIN_S
            state.say(Severity.NOTICE, f"{name(one)} crossing: waiting {seconds:.0f} s")
        if self._since_ns is None:
            return None
        if one is not None:
            self._crossed_ns = s.now_ns
        if self._is_over(s):
            self.reset()
            state.restart_limit(s)
            return None
        if state.phase is Phase.FINAL:
            state.go(Phase.DESCEND, s)
        state.restart_limit(s)
        held = VehicleCommands(velocity_enu_ms=STOPPED, target_enu_m=state.aim.on_ground_enu_m)
        return held if s.guided else replace(held, mode="guided")

    def _crosser(self, s: Situation) -> MovingObject | None:
        aim, p = self._state.aim, self._state.parameters
        one = crossing(s, aim, p)
        if one is None and (self.is_on or self._state.why_not(s) is not None):
            one = on_the_point(s, aim, p)
        return one if one is not None and one.radius_m < SMALL_M else None

    def _is_over(self, s: Situation) -> bool:
        """Return whether the landing goes on, or something else must be done about the point."""
        if s.now_ns - (self._since_ns or 0) > LONGEST_NS:
            return True
        free_ns = s.now_ns - self._crossed_ns
        return free_ns > GIVEN_BACK_NS or (free_ns > FREE_NS and self._state.why_not(s) is None)
