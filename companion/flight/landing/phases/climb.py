"""Phases climb and hold: after an abort up to survey height, then survey again or wait for the operator."""

from __future__ import annotations

from companion.flight.landing.interruptions.missing_input import report_input_back, without_lidar
from companion.flight.landing.landing_state import SECOND, STUCK_NS, LandingState
from companion.flight.landing.situation import (
    STOPPED,
    LandingRequest,
    Phase,
    Severity,
    Situation,
    Vector,
    VehicleCommands,
    known,
)
from companion.flight.landing.ways.way_out import WayOut

STEADY_NS = 2 * SECOND  # at survey height before the next choice
AT_HEIGHT_M = 1.0  # below survey height
STUCK_BELOW_NS = 5 * SECOND  # under something, without a way aside


class Climb:
    """Climbs in guided mode."""

    def __init__(self, state: LandingState) -> None:
        self._state = state
        self._way_out = WayOut(state.parameters)
        self._below_since_ns: int | None = None  # under something, without a way aside

    def leave_landing(self, s: Situation) -> VehicleCommands:
        """Leave a landing mode entered after it was given up: nobody chose this ground."""
        self._state.say(Severity.WARNING, "LAND came late: climbing")
        self._state.go(Phase.CLIMB, s)
        return VehicleCommands(mode="guided", velocity_enu_ms=STOPPED)

    def commands(self, s: Situation) -> VehicleCommands:
        """Climb; at survey height choose again, or hold until the next order."""
        state = self._state
        up = self._velocity_enu_ms(s)
        left_m = state.route.height_m - float(known(s.position_enu_m)[2])
        if s.lidar_ok or left_m > AT_HEIGHT_M:  # climbing needs no map
            report_input_back(state, s)
        if left_m <= AT_HEIGHT_M:
            state.restart_limit(s)
        elif s.now_ns > state.late_ns:
            state.call("not climbing", s)
        if not s.guided:
            return VehicleCommands(mode="guided", velocity_enu_ms=up)
        if left_m > AT_HEIGHT_M:
            return VehicleCommands(velocity_enu_ms=up)
        if not s.lidar_ok:
            return without_lidar(state, s)
        if state.phase is Phase.HOLD or s.now_ns - state.since_ns < STEADY_NS:
            return VehicleCommands(velocity_enu_ms=STOPPED)
        state.say(Severity.INFO, "choosing again")
        if state.request is not None and not state.keeps_request:
            state.request = LandingRequest(urgent=state.request.urgent or state.is_battery_low(s))
        state.go(Phase.SURVEY, s)
        state.end_survey(s)
        return VehicleCommands(velocity_enu_ms=STOPPED)

    def _velocity_enu_ms(self, s: Situation) -> Vector:
        """Return the velocity (3,) of the climb; report when it leads aside, or nowhere."""
        state, aside = self._state, self._way_out.leads_aside
        velocity = self._way_out.velocity_enu_ms(s, known(s.position_enu_m), state.path, state.corridors(s))
        if self._way_out.leads_aside and not aside:
            state.say(Severity.WARNING, "something above: leaving aside")
        if not s.blocked_above or self._way_out.leads_aside:
            self._below_since_ns = None
        elif self._below_since_ns is None:
            self._below_since_ns = s.now_ns
        elif s.now_ns - self._below_since_ns > STUCK_BELOW_NS:
            self._below_since_ns = s.now_ns + STUCK_NS
            state.call("something above, no way aside", s)
        return velocity
