"""Transitions between the phases of a landing, with the time limit of each phase."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from companion.flight.landing.aim import PointSelection
from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.orders.mode_ownership import ModeOwnership
from companion.flight.landing.outage import GpsLoss, Outage
from companion.flight.landing.pilot_texts import PilotTexts
from companion.flight.landing.route import Route
from companion.flight.landing.situation import (
    COMMANDING,
    STOPPED,
    LandingRequest,
    Phase,
    Severity,
    Situation,
    Vector,
    VehicleCommands,
    known,
)
from companion.flight.landing.ways.endurance import LANDING_MS
from companion.flight.landing.wind.landing_wind import LandingWind
from params import Parameters

SECOND = 1_000_000_000
STUCK_NS = 60 * SECOND  # beyond twice the travel time of a phase
TAKE_OVER_NS = 5 * SECOND  # limit for the autopilot to obey an emergency


class Transitions:
    """Changes of phase and request, which no other code makes."""

    def __init__(
        self,
        parameters: Parameters,
        progress: LandingProgress,
        texts: PilotTexts,
        route: Route,
        selection: PointSelection,
        ownership: ModeOwnership,
        outage: Outage,
        wind: LandingWind,
        gps_loss: GpsLoss,
    ) -> None:
        self._p, self._progress, self._texts = parameters, progress, texts
        self._route, self._selection, self._ownership = route, selection, ownership
        self._outage, self._wind, self._gps_loss = outage, wind, gps_loss

    def enter_phase(self, phase: Phase, s: Situation) -> None:
        """Enter a phase."""
        progress = self._progress
        progress.phase = phase
        self._wind.into_wind.freeze(phase in (Phase.DESCEND, Phase.FINAL))
        progress.order_count += phase not in (Phase.APPROACH, Phase.DESCEND, Phase.FINAL)
        progress.since_ns = s.now_ns
        self.restart_limit(s)
        progress.level_since_ns = None
        self._route.unblocked()

    def begin_request(self, request: LandingRequest, s: Situation, *, taken_over: bool = False) -> None:
        """Begin a requested landing, or one taken over from the autopilot."""
        progress = self._progress
        progress.request, progress.started_ns, progress.is_taken_over = request, s.now_ns, taken_over
        progress.refused.clear()
        progress.keeps_request, progress.n_given = False, 0
        self.start_survey(s)

    def replace_request(self, urgent: bool) -> None:
        """Let the landing under way go to any zone, or to the one that is reached soonest."""
        self._progress.request = LandingRequest(urgent=urgent)

    def cancel_request(self) -> None:
        """Cancel the request, in the same phase."""
        self._progress.request = None

    def end_request(self, phase: Phase, s: Situation) -> None:
        """End the request: nothing more is commanded."""
        self.cancel_request()
        self._ownership.clear()
        self._outage.reset()
        self.enter_phase(phase, s)

    def start_survey(self, s: Situation) -> None:
        """Begin the search for a zone at the vehicle's position."""
        if s.position_enu_m is None:
            self._texts.say(Severity.WARNING, "no position: waiting")
            self._route.forget()
        else:
            # After an abort close to the ground, an order does not end the climb.
            least_m = self._route.height_m if self._progress.phase in COMMANDING else -np.inf
            self._route.start_search(s.position_enu_m, s.height_above_home_m, least_m)
        self._texts.say(Severity.INFO, "surveying")
        self._outage.reset()
        self.enter_phase(Phase.SURVEY, s)

    def end_survey(self, s: Situation) -> None:
        """Let the present map count as the survey."""
        self._progress.since_ns = s.now_ns - round(self._p.survey_s * 1e9)

    def take_over(self, s: Situation) -> VehicleCommands:
        """Request the guided mode after an emergency order; give up if the autopilot refuses."""
        if s.now_ns - self._progress.started_ns > TAKE_OVER_NS:
            self._texts.say(Severity.CRITICAL, f"{s.mode} stays: not landing")
            self.end_request(Phase.IDLE, s)
            return VehicleCommands()
        return VehicleCommands(mode="guided", velocity_enu_ms=STOPPED)

    def aim_at(self, s: Situation, enu_m: Vector) -> None:
        """Set the target point, and select it for the reports to come."""
        aim = self._progress.aim
        aim.set_target(enu_m)
        aim.follow(s)
        self._progress.tally.chosen_enu_m = aim.enu_m
        self._selection.select(aim.enu_m)

    def resume_landing(self, s: Situation, enu_m: Vector) -> None:
        """Adopt the autopilot's landing at a point, which began before a restart or a silence of the link."""
        self.aim_at(s, enu_m)
        self._route.start_search(known(s.position_enu_m), s.height_above_home_m, -np.inf)
        self._ownership.adopt_landing(s)
        self._outage.reset()
        self.enter_phase(Phase.FINAL, s)

    def break_off(
        self, reason: str, s: Situation, hold: bool = False, *, keeps_point: bool = False
    ) -> VehicleCommands:
        """Leave the point: stop, or climb at once where the autopilot is landing.

        keeps_point: it may be landed at later.
        """
        progress = self._progress
        progress.keeps_request, progress.is_ordered_abort = keeps_point, hold
        progress.tally.aborts += 1
        progress.tally.abort_reasons.append(reason)
        self._texts.say(Severity.WARNING, f"abort: {reason}")
        if progress.aim.enu_m is not None and not hold and not keeps_point:
            progress.refused.append(progress.aim.enu_m)
        landing = progress.phase is Phase.FINAL
        self.enter_phase(Phase.HOLD if hold else Phase.CLIMB, s)
        climb_ms = self._p.climb_speed_ms if landing and not self._gps_loss.is_on else 0.0
        return VehicleCommands(
            mode="guided" if landing else None, velocity_enu_ms=np.array([0.0, 0.0, climb_ms])
        )

    def call_pilot(self, trouble: str, s: Situation) -> None:
        """Call the pilot, again each minute, about a vehicle that does not obey; begin nothing afterwards."""
        self._texts.say(Severity.CRITICAL, f"{trouble}: take over")
        if self._progress.phase not in (Phase.FINAL, Phase.HOLD):
            self.enter_phase(Phase.HOLD, s)
        self._progress.late_ns = s.now_ns + STUCK_NS

    def restart_limit(self, s: Situation) -> None:
        """Set the time limit of the phase to a minute and twice its travel time from now."""
        p, progress, way_s = self._p, self._progress, 0.0
        match progress.phase:
            case Phase.APPROACH:
                way_s = progress.aim.away_m / p.approach_speed_ms
            case Phase.DESCEND:
                way_s = progress.aim.height_left_m / p.descent_speed_ms
                if progress.path is not None:
                    way_s += progress.path.length_m / p.approach_speed_ms
            case Phase.FINAL:
                way_s = progress.aim.height_left_m / LANDING_MS
            case Phase.CLIMB | Phase.HOLD if s.position_enu_m is not None:
                rise_m = max(0.0, self._route.height_m - float(s.position_enu_m[2]))
                way_s = rise_m / p.climb_speed_ms
        progress.late_ns = s.now_ns + STUCK_NS + round(2e9 * way_s)


class LandingCore(NamedTuple):
    """Objects that every phase and most interruptions use."""

    parameters: Parameters
    progress: LandingProgress
    texts: PilotTexts
    transitions: Transitions
