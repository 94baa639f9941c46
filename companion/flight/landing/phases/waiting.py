"""Phases idle and landed: on the ground, or in the air under somebody else's command."""

from __future__ import annotations

import numpy as np

from companion.flight.landing.landing_state import SECOND, LandingState
from companion.flight.landing.situation import LandingRequest, Phase, Severity, Situation, VehicleCommands

STEADY_NS = 2 * SECOND  # airborne and level before an automatic start
TELL_AGAIN_NS = 30 * SECOND
LEAST_HEIGHT_M = 5.0  # above home, for an automatic start; less with a lower survey height
LEVEL_MS = 0.3  # greatest vertical speed of a vehicle that is level


class Waiting:
    """Waits for an order; in auto mode it starts one itself."""

    def __init__(self, state: LandingState) -> None:
        self._state = state
        self._disarmed = False  # since the last landing

    def finish(self, s: Situation) -> VehicleCommands:
        """End the flight: report how far from the point the vehicle stands."""
        state = self._state
        if state.phase is not Phase.FINAL:
            state.say(Severity.NOTICE, "disarmed")
            state.rest(Phase.IDLE, s)
            return VehicleCommands()
        off_m = state.aim.away_m
        state.tally.off_point_m = off_m if np.isfinite(off_m) else None
        if off_m > state.parameters.off_point_m:
            state.say(Severity.WARNING, f"landed {off_m:.1f} m off the point")
        else:
            state.say(Severity.NOTICE, f"landed, {off_m:.2f} m off the point")
        state.rest(Phase.LANDED, s)
        self._disarmed = False
        return self.commands(s)

    def commands(self, s: Situation) -> VehicleCommands:
        """In auto mode start when the vehicle has been airborne, guided and level for two seconds.

        After a landing the target is streamed until the vehicle is armed again: ArduPilot reports the end of
        the stream as "PrecLand: Target Lost" at CRITICAL, disarmed or not, which a pilot takes for a fault.
        """
        state = self._state
        if state.phase is Phase.LANDED and self._stands(s):
            return VehicleCommands(target_enu_m=state.aim.on_ground_enu_m)
        self._tell_to_hand_over(s)
        if not self._is_ready(s):
            state.level_since_ns = None
        elif state.too_windy(s):
            state.level_since_ns = None
            state.report_wind(s)
        elif state.level_since_ns is None:
            state.level_since_ns = s.now_ns
        elif s.now_ns - state.level_since_ns > STEADY_NS:
            state.start(LandingRequest(urgent=state.is_battery_low(s)), s)
        return VehicleCommands()

    def _is_ready(self, s: Situation) -> bool:
        return (
            self._state.auto
            and s.fit
            and self._state.hand_over.given
            and not s.estimate_lost
            and not s.no_command_reason
            and s.connected
            and s.armed
            and s.guided
            and s.on_ground is False
            and s.position_enu_m is not None
            and s.velocity_enu_ms is not None
            and abs(float(s.velocity_enu_ms[2])) < LEVEL_MS
            and s.height_above_home_m > min(LEAST_HEIGHT_M, self._state.parameters.survey_height_m)
        )

    def _tell_to_hand_over(self, s: Situation) -> None:
        """Report now and then that the guided mode has no effect without a new hand-over."""
        state = self._state
        alone = state.auto and s.connected and s.armed and s.guided and s.on_ground is False
        told_ns = state.told_to_hand_over_ns
        if not alone or state.hand_over.given or s.no_command_reason:
            state.told_to_hand_over_ns = None
        elif told_ns is None or s.now_ns - told_ns > TELL_AGAIN_NS:
            state.told_to_hand_over_ns = s.now_ns
            state.call_for_hand_over("no hand-over", s)

    def _stands(self, s: Situation) -> bool:
        """Return whether the vehicle has stood where it landed since then, and was not armed again."""
        self._disarmed = self._disarmed or (s.connected and not s.armed)
        return s.on_ground is True and not (s.armed and self._disarmed)
