"""Phases climb and hold: after an abort up to survey height, then survey again or wait for the operator."""

from __future__ import annotations

import numpy as np

from companion.flight.landing.interruptions.missing_input import report_input_back, without_lidar
from companion.flight.landing.landing_state import SECOND, LandingState
from companion.flight.landing.situation import (
    STOPPED,
    LandingRequest,
    Phase,
    Severity,
    Situation,
    VehicleCommands,
    known,
)

STEADY_NS = 2 * SECOND  # at survey height before the next choice
AT_HEIGHT_M = 1.0  # below survey height


class Climb:
    """Climbs in guided mode."""

    def __init__(self, state: LandingState) -> None:
        self._state = state

    def leave_landing(self, s: Situation) -> VehicleCommands:
        """Leave a landing mode entered after it was given up: nobody chose this ground."""
        self._state.say(Severity.WARNING, "LAND came late: climbing")
        self._state.go(Phase.CLIMB, s)
        return VehicleCommands(mode="guided", velocity_enu_ms=STOPPED)

    def commands(self, s: Situation) -> VehicleCommands:
        """Climb; at survey height choose again, or hold until the next order."""
        state = self._state
        up = np.array([0.0, 0.0, state.parameters.climb_speed_ms])
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
