"""Wait over the point while somebody crosses it.

People, dogs and balls pass; vehicles may stop, so that the landing is broken off for them at once.
"""

from __future__ import annotations

from dataclasses import replace

from companion.flight.landing.interruptions.crossing import (
    crossing,
    lately_on_the_point,
    leaves_after_s,
    name,
    on_the_point,
)
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
LEAST_HEIGHT_M, OVER_HEAD_M = 3.0, 2.0  # over the point and over who crosses, for a wait; lower, it climbs
FREE_NS = SECOND  # nobody crosses, before the landing goes on
GIVEN_BACK_NS = 12 * SECOND  # after somebody left, until which the map must show point and way in safe again
LONGEST_NS = 20 * SECOND
MOST_NS = 60 * SECOND  # of all waits of a landing
KNOWN_NS = 2 * SECOND  # for which an object goes on as it did, whose track was lost
MARGIN_S = 1.0  # of the time told to the pilot


class CrossingWait:
    """Holds the vehicle where it is, in the descent or the autopilot's landing."""

    def __init__(self, state: LandingState) -> None:
        self._state = state
        self._since_ns: int | None = None
        self._crossed_ns = 0  # last time at which somebody was crossing
        self._asked_ns = 0
        self._landing_ns: int | None = None  # when the landing was ordered
        self._waited_ns = 0
        self._known: dict[int, MovingObject] = {}

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
        self._follow(s)
        crossers = self._crossers(s)
        highest_m = max((one.height_m for one in crossers), default=0.0)
        low = state.aim.height_left_m < max(LEAST_HEIGHT_M, highest_m + OVER_HEAD_M)
        hurried = state.is_urgent or state.is_battery_low(s) or self._waited_ns > MOST_NS
        large = any(one.radius_m >= SMALL_M for one in crossers)
        if low or large or hurried or not s.lidar_ok or state.path is not None:
            self.reset()
            return None
        if crossers and self._since_ns is None:
            self._since_ns = s.now_ns
            one = max(crossers, key=lambda other: leaves_after_s(other, s, state.aim, state.parameters))
            seconds = leaves_after_s(one, s, state.aim, state.parameters) + MARGIN_S
            state.say(Severity.NOTICE, f"{name(one)} crossing: waiting {seconds:.0f} s")
        if self._since_ns is None:
            return None
        if crossers:
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

    def _follow(self, s: Situation) -> None:
        """Sum up the time waited in this landing; a wait of another descent is over."""
        since_asked_ns = s.now_ns - self._asked_ns
        if since_asked_ns > SECOND:
            self.reset()
        if self._landing_ns != self._state.started_ns:
            self._landing_ns, self._waited_ns = self._state.started_ns, 0
        if self._since_ns is not None:
            self._waited_ns += since_asked_ns
        self._asked_ns = s.now_ns
        seen = self._known | {one.number: one for one in s.moving}
        self._known = {number: one for number, one in seen.items() if s.now_ns - one.stamp_ns < KNOWN_NS}

    def _crossers(self, s: Situation) -> tuple[MovingObject, ...]:
        aim, p = self._state.aim, self._state.parameters
        coming = crossing(s, aim, p)
        if self._state.why_not(s) is not None:  # it may be they that the map shows
            return *coming, *lately_on_the_point(self._known.values(), s, aim, p)
        return (*coming, *on_the_point(s, aim, p)) if self.is_on else coming

    def _is_over(self, s: Situation) -> bool:
        """Return whether the landing goes on, or something else must be done about the point."""
        if s.now_ns - (self._since_ns or 0) > LONGEST_NS:
            return True
        free_ns = s.now_ns - self._crossed_ns
        return free_ns > GIVEN_BACK_NS or (free_ns > FREE_NS and self._state.why_not(s) is None)
