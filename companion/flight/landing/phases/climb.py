"""Phases climb and hold: after an abort up to survey height, then survey again or wait for the operator."""

from __future__ import annotations

from companion.flight.landing.check_order import Check
from companion.flight.landing.interruptions.missing_input import MissingInputs
from companion.flight.landing.route import Route
from companion.flight.landing.situation import (
    STOPPED,
    Phase,
    Severity,
    Situation,
    Vector,
    VehicleCommands,
    known,
)
from companion.flight.landing.transitions import SECOND, STUCK_NS, LandingCore
from companion.flight.landing.ways.endurance import is_battery_low
from companion.flight.landing.ways.way_choice import corridors_of
from companion.flight.landing.ways.way_out import WayOut

STEADY_NS = 2 * SECOND  # at survey height before the next choice
AT_HEIGHT_M = 1.0  # below survey height
STUCK_BELOW_NS = 5 * SECOND  # under something, without a way aside


class Climb:
    """Climbs in guided mode."""

    def __init__(self, core: LandingCore, route: Route, missing_inputs: MissingInputs) -> None:
        self.checks: tuple[Check, ...] = (
            self.way_up, self.input_back, self.time_limit, self.guided_mode, self.height, self.scans,
            self.steadiness, self.next_choice,
        )  # fmt: skip
        self._p, self._progress, self._texts, self._transitions = core
        self._route, self._missing_inputs = route, missing_inputs
        self._way_out = WayOut(self._p)
        self._up_ms: Vector = STOPPED  # (3,) velocity of this step's climb
        self._below_since_ns: int | None = None  # under something, without a way aside

    def way_up(self, s: Situation) -> None:
        """Determine the velocity of the climb; report when it leads aside, or nowhere."""
        aside, corridors = self._way_out.leads_aside, corridors_of(s, self._progress.aim)
        position = known(s.position_enu_m)
        self._up_ms = self._way_out.velocity_enu_ms(s, position, self._progress.path, corridors)
        if self._way_out.leads_aside and not aside:
            self._texts.say(Severity.WARNING, "something above: leaving aside")
        if not s.blocked_above or self._way_out.leads_aside:
            self._below_since_ns = None
        elif self._below_since_ns is None:
            self._below_since_ns = s.now_ns
        elif s.now_ns - self._below_since_ns > STUCK_BELOW_NS:
            self._below_since_ns = s.now_ns + STUCK_NS
            self._transitions.call_pilot("something above, no way aside", s)

    def input_back(self, s: Situation) -> None:
        """Report the input of a call that is back; climbing needs no map."""
        if s.lidar_ok or self._is_below(s):
            self._missing_inputs.report_back(s)

    def time_limit(self, s: Situation) -> None:
        """Call the pilot where the vehicle does not climb in time."""
        if not self._is_below(s):
            self._transitions.restart_limit(s)
        elif s.now_ns > self._progress.late_ns:
            self._transitions.call_pilot("not climbing", s)

    def guided_mode(self, s: Situation) -> VehicleCommands | None:
        """Request the guided mode."""
        return None if s.guided else VehicleCommands(mode="guided", velocity_enu_ms=self._up_ms)

    def height(self, s: Situation) -> VehicleCommands | None:
        """Climb to survey height."""
        return VehicleCommands(velocity_enu_ms=self._up_ms) if self._is_below(s) else None

    def scans(self, s: Situation) -> VehicleCommands | None:
        """Hold without scans."""
        return None if s.lidar_ok else self._missing_inputs.without_lidar(s)

    def steadiness(self, s: Situation) -> VehicleCommands | None:
        """Hover in a hold, and for a while before the next choice."""
        holds = self._progress.phase is Phase.HOLD or s.now_ns - self._progress.since_ns < STEADY_NS
        return VehicleCommands(velocity_enu_ms=STOPPED) if holds else None

    def next_choice(self, s: Situation) -> VehicleCommands:
        """Choose again by the present map."""
        progress = self._progress
        self._texts.say(Severity.INFO, "choosing again")
        if progress.request is not None and not progress.keeps_request:
            self._transitions.replace_request(progress.request.urgent or is_battery_low(s, self._p))
        self._transitions.enter_phase(Phase.SURVEY, s)
        self._transitions.end_survey(s)
        return VehicleCommands(velocity_enu_ms=STOPPED)

    def _is_below(self, s: Situation) -> bool:
        return self._route.height_m - float(known(s.position_enu_m)[2]) > AT_HEIGHT_M
