"""Phases idle and landed: on the ground, or in the air under somebody else's command."""

from __future__ import annotations

import numpy as np

from companion.flight.landing.check_order import Check, decided
from companion.flight.landing.orders.mode_ownership import HandOver
from companion.flight.landing.outage import GpsLoss
from companion.flight.landing.situation import (
    LandingRequest,
    Phase,
    Severity,
    Situation,
    VehicleCommands,
    known,
)
from companion.flight.landing.transitions import SECOND, LandingCore
from companion.flight.landing.ways.endurance import is_battery_low
from companion.flight.landing.wind.landing_wind import LandingWind

STEADY_NS = 2 * SECOND  # airborne and level before an automatic start
TELL_AGAIN_NS = 30 * SECOND
LEAST_HEIGHT_M = 5.0  # over ground, for an automatic start; less with a lower survey height
REASON_NS = 5 * SECOND  # for which a start waits before the reason is reported
LEVEL_MS = 0.3  # greatest vertical speed of a vehicle that is level


class Waiting:
    """Waits for an order; in auto mode it starts one itself."""

    def __init__(
        self, core: LandingCore, auto: bool, hand_over: HandOver, wind: LandingWind, gps_loss: GpsLoss
    ) -> None:
        self.checks: tuple[Check, ...] = (
            self.landed, self.new_hand_over, self.automatic_start, self.inputs, self.climb, self.wind,
            self.start,
        )  # fmt: skip
        self._p, self._progress, self._texts, self._transitions = core
        self._auto, self._hand_over = auto, hand_over
        self._wind, self._gps_loss = wind, gps_loss
        self._disarmed = False  # since the last landing
        self._waits_for: tuple[Severity, str] | None = None
        self._waits_since_ns = 0
        self._reported: set[tuple[Severity, str]] = set()  # reasons to wait since the hand-over

    def finish(self, s: Situation) -> VehicleCommands:
        """End the flight: report how far from the point the vehicle stands."""
        progress, say = self._progress, self._texts.say
        if progress.phase is not Phase.FINAL:
            say(Severity.NOTICE, "disarmed")
            self._transitions.end_request(Phase.IDLE, s)
            return VehicleCommands()
        off_m = progress.aim.away_m
        progress.tally.landed_enu_m = s.position_enu_m
        progress.tally.off_point_m = off_m if np.isfinite(off_m) else None
        if off_m > self._p.off_point_m:
            say(Severity.WARNING, f"landed {off_m:.1f} m off the point")
        else:
            say(Severity.NOTICE, f"landed, {off_m:.2f} m off the point")
        self._transitions.end_request(Phase.LANDED, s)
        self._disarmed = False
        return decided(self.checks, s)

    def report_restart(self, s: Situation, how: str) -> None:
        """Report the start in flight (`how`), and its consequence."""
        say = self._texts.say
        if s.landing and self._p.assist != "off":
            return  # it is led as soon as there is a map, or told why not
        if s.landing:
            say(Severity.CRITICAL, f"{how} in {s.mode}: landing not watched, take over")
        elif self._auto and s.guided and self._hand_over.given:
            say(Severity.WARNING, f"{how} in flight: going on")
        else:
            self._texts.ask_for_hand_over(how, s, self._auto)

    def landed(self, s: Situation) -> VehicleCommands | None:
        """Stream the target after a landing until the vehicle is armed again.

        ArduPilot reports the end of the stream as "PrecLand: Target Lost" at CRITICAL, disarmed or not, which
        a pilot takes for a fault.
        """
        if self._progress.phase is not Phase.LANDED or not self._stands(s):
            return None
        return VehicleCommands(target_enu_m=self._progress.aim.on_ground_enu_m)

    def new_hand_over(self, s: Situation) -> None:
        """Report now and then that the guided mode has no effect without a new hand-over."""
        hand_over = self._hand_over
        alone = self._auto and s.connected and s.armed and s.guided and s.on_ground is False
        if not alone or hand_over.given or s.no_command_reason:
            hand_over.asked_ns = None
        elif hand_over.asked_ns is None or s.now_ns - hand_over.asked_ns > TELL_AGAIN_NS:
            hand_over.asked_ns = s.now_ns
            self._texts.ask_for_hand_over("no hand-over", s, self._auto)

    def automatic_start(self, s: Situation) -> VehicleCommands | None:
        """Go on to an automatic start only where the pilot handed over to one."""
        handed_over = s.connected and s.armed and s.guided and s.on_ground is not True
        if self._auto and handed_over and self._hand_over.given and not s.no_command_reason:
            return None
        self._progress.level_since_ns = self._waits_for = None
        self._reported.clear()
        return VehicleCommands()

    def inputs(self, s: Situation) -> VehicleCommands | None:
        """Wait for an input that an automatic start lacks."""
        reason = self._missing(s)
        return self._wait(Severity.WARNING, reason, s) if reason else None

    def climb(self, s: Situation) -> VehicleCommands | None:
        """Wait for the vehicle to climb, or to be level."""
        reason = self._ended_by_climb(s)
        if not reason:
            return None
        climbs = float(known(s.velocity_enu_ms)[2]) >= LEVEL_MS
        return self._wait(Severity.INFO if climbs else Severity.WARNING, reason, s)

    def wind(self, s: Situation) -> VehicleCommands | None:
        """Wait for less wind."""
        if not self._wind.too_windy(s):
            return None
        self._progress.level_since_ns = None
        self._wind.report(s)
        return VehicleCommands()

    def start(self, s: Situation) -> VehicleCommands:
        """Start after two seconds of level flight."""
        progress = self._progress
        if progress.level_since_ns is None:
            progress.level_since_ns, self._waits_for = s.now_ns, None
        elif s.now_ns - progress.level_since_ns > STEADY_NS:
            request = LandingRequest(urgent=is_battery_low(s, self._p))
            self._transitions.begin_request(request, s)
        return VehicleCommands()

    def _missing(self, s: Situation) -> str:
        """Return the input that an automatic start lacks, "" where it has all."""
        if not s.fit:
            return "autopilot's parameters"
        if s.estimate_lost or self._gps_loss.is_on:
            return f"{s.estimate_lost or 'GPS'} lost"
        if s.position_enu_m is None or s.velocity_enu_ms is None:
            return "no position"
        if s.on_ground is not False:
            return "landed state unknown"
        return "" if s.lidar_ok else s.no_map_reason.text

    def _ended_by_climb(self, s: Situation) -> str:
        """Return what delays an automatic start until the vehicle has climbed, "" for nothing."""
        height_m = float("nan") if s.report is None else s.report.choice.height_m
        least_m = min(LEAST_HEIGHT_M, self._p.survey_height_m)
        if np.isnan(height_m):
            return "no ground seen"
        if height_m <= least_m:
            return f"lower than {least_m:.0f} m over ground"
        return "not level" if abs(float(known(s.velocity_enu_ms)[2])) >= LEVEL_MS else ""

    def _wait(self, severity: Severity, reason: str, s: Situation) -> VehicleCommands:
        """Wait; report a reason that lasts, once in a hand-over."""
        self._progress.level_since_ns = None
        text = f"{reason}: waiting"
        self._texts.note_lasting(text)
        if (severity, reason) != self._waits_for:
            self._waits_for, self._waits_since_ns = (severity, reason), s.now_ns
        if self._waits_for not in self._reported and s.now_ns - self._waits_since_ns >= REASON_NS:
            self._reported.add(self._waits_for)
            self._texts.say(severity, text)
        return VehicleCommands()

    def _stands(self, s: Situation) -> bool:
        """Return whether the vehicle stands since its landing, and was not armed again."""
        self._disarmed = self._disarmed or (s.connected and not s.armed)
        return s.on_ground is True and not (s.armed and self._disarmed)
