"""Phases idle and landed: on the ground, or in the air under somebody else's command."""

from __future__ import annotations

import numpy as np

from companion.flight.landing.landing_state import SECOND, LandingState
from companion.flight.landing.situation import (
    LandingRequest,
    Phase,
    Severity,
    Situation,
    VehicleCommands,
    known,
)

STEADY_NS = 2 * SECOND  # airborne and level before an automatic start
TELL_AGAIN_NS = 30 * SECOND
LEAST_HEIGHT_M = 5.0  # over ground, for an automatic start; less with a lower survey height
REASON_NS = 5 * SECOND  # for which a start waits before the pilot is told why
LEVEL_MS = 0.3  # greatest vertical speed of a vehicle that is level


class Waiting:
    """Waits for an order; in auto mode it starts one itself."""

    def __init__(self, state: LandingState) -> None:
        self._state = state
        self._disarmed = False  # since the last landing
        self._waits_for: tuple[Severity, str] | None = None
        self._waits_since_ns = 0
        self._reported: set[tuple[Severity, str]] = set()  # reasons to wait since the hand-over

    def finish(self, s: Situation) -> VehicleCommands:
        """End the flight: report how far from the point the vehicle stands."""
        state = self._state
        if state.phase is not Phase.FINAL:
            state.say(Severity.NOTICE, "disarmed")
            state.rest(Phase.IDLE, s)
            return VehicleCommands()
        off_m = state.aim.away_m
        state.tally.landed_enu_m = s.position_enu_m
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
        if not self._is_wanted(s):
            state.level_since_ns = self._waits_for = None
            self._reported.clear()
        elif reason := self._missing(s):
            state.level_since_ns = None
            self._report(Severity.WARNING, reason, s)
        elif reason := self._ended_by_climb(s):
            state.level_since_ns = None
            climbs = float(known(s.velocity_enu_ms)[2]) >= LEVEL_MS
            self._report(Severity.INFO if climbs else Severity.WARNING, reason, s)
        elif state.too_windy(s):
            state.level_since_ns = None
            state.report_wind(s)
        elif state.level_since_ns is None:
            state.level_since_ns, self._waits_for = s.now_ns, None
        elif s.now_ns - state.level_since_ns > STEADY_NS:
            state.start(LandingRequest(urgent=state.is_battery_low(s)), s)
        return VehicleCommands()

    def _is_wanted(self, s: Situation) -> bool:
        """Return whether the pilot handed over to an automatic start."""
        handed_over = s.connected and s.armed and s.guided and s.on_ground is not True
        return self._state.auto and handed_over and self._state.hand_over.given and not s.no_command_reason

    def _missing(self, s: Situation) -> str:
        """Return the input that an automatic start lacks, "" where it has all."""
        if not s.fit:
            return "autopilot's parameters"
        if s.estimate_lost or self._state.gps_loss.is_on:
            return f"{s.estimate_lost or 'GPS'} lost"
        if s.position_enu_m is None or s.velocity_enu_ms is None:
            return "no position"
        if s.on_ground is not False:
            return "landed state unknown"
        return "" if s.lidar_ok else s.no_map_reason.text

    def _ended_by_climb(self, s: Situation) -> str:
        """Return what delays an automatic start until the vehicle has climbed, "" for nothing."""
        height_m = float("nan") if s.report is None else s.report.choice.height_m
        least_m = min(LEAST_HEIGHT_M, self._state.parameters.survey_height_m)
        if np.isnan(height_m):
            return "no ground seen"
        if height_m <= least_m:
            return f"lower than {least_m:.0f} m over ground"
        return "not level" if abs(float(known(s.velocity_enu_ms)[2])) >= LEVEL_MS else ""

    def _report(self, severity: Severity, reason: str, s: Situation) -> None:
        """Report a reason to wait that lasts, once in a hand-over."""
        text = f"{reason}: waiting"
        self._state.note_lasting(text)
        if (severity, reason) != self._waits_for:
            self._waits_for, self._waits_since_ns = (severity, reason), s.now_ns
        if self._waits_for not in self._reported and s.now_ns - self._waits_since_ns >= REASON_NS:
            self._reported.add(self._waits_for)
            self._state.say(severity, text)

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
