"""Phase survey: fly an expanding square until a zone can be chosen."""

from __future__ import annotations

from functools import partial

import numpy as np

from companion.flight.landing.check_order import Check
from companion.flight.landing.fenced_zones import FencedZones, beyond_fence
from companion.flight.landing.interruptions.missing_input import MissingInputs
from companion.flight.landing.looks.oblique_look import ObliqueLook
from companion.flight.landing.phases.approach import Approach
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
from companion.flight.landing.transitions import SECOND, LandingCore
from companion.flight.landing.wind.landing_wind import LandingWind, gust_drift_m
from companion.flight.landing.zone_choice import SoonestZone, choose, confirmable, look_at
from slz import SurfaceHere, Zone

SEARCH_NS = 300 * SECOND  # beyond `survey_s`, before the pilot is called
ASK_AGAIN_NS = 30 * SECOND  # for the confirmation of a zone
MOST_LOOKS, APART_M = 3, 50.0  # from aside, in one survey, and between them


class Survey:
    """Searches for a zone and hands it to the approach."""

    def __init__(
        self,
        core: LandingCore,
        route: Route,
        wind: LandingWind,
        missing_inputs: MissingInputs,
        fenced: FencedZones,
        soonest: SoonestZone,
        approach: Approach,
    ) -> None:
        self.checks: tuple[Check, ...] = (
            self.guided_mode, self.position, self.scans, self.wind, self.ordered_point, self.zone,
            self.question, self.search_time, self.look_aside, self.corner,
        )  # fmt: skip
        self._p, self._progress, self._texts, self._transitions = core
        self._route, self._wind = route, wind
        self._missing_inputs, self._fenced, self._soonest = missing_inputs, fenced, soonest
        self._approach, self._aside = approach, ObliqueLook(self._p, self._progress, self._texts)
        self._asked_ns: int | None = None
        self._looked: list[tuple[Vector, SurfaceHere]] = []  # places in this survey, and their surface then
        self._looked_since_ns = 0

    def guided_mode(self, s: Situation) -> VehicleCommands | None:
        """Request the guided mode after an emergency order."""
        return None if s.guided else self._transitions.take_over(s)

    def position(self, s: Situation) -> VehicleCommands | None:
        """Begin the search where the position is known since this step."""
        if self._route.begun:
            return None
        self._transitions.start_survey(s)
        return VehicleCommands(velocity_enu_ms=STOPPED)

    def scans(self, s: Situation) -> VehicleCommands | None:
        """Hold without scans."""
        if not s.lidar_ok:
            return self._missing_inputs.without_lidar(s)
        self._missing_inputs.on_present(s)
        return None

    def wind(self, s: Situation) -> VehicleCommands | None:
        """Hover in too strong a wind; the time to search for a zone begins when the wind is less."""
        request = self._progress.request
        if not self._wind.too_windy(s) or not (
            self._has_lasted(s) or (request and request.enu_m is not None)
        ):
            return None
        self._wind.report(s)
        self._transitions.end_survey(s)
        return VehicleCommands(velocity_enu_ms=STOPPED)

    def ordered_point(self, s: Situation) -> VehicleCommands | None:
        """Approach the point that was ordered."""
        request = self._progress.request
        if request is None or request.enu_m is None:
            return None
        return self._approach.start(s, request.enu_m, request.zone_id)

    def zone(self, s: Situation) -> VehicleCommands | None:
        """Approach the zone that is chosen now."""
        zone = self._choice(s)
        return None if zone is None else self._approach.start(s, zone.best.enu_m, zone.id)

    def question(self, s: Situation) -> None:
        """Report now and then a zone to confirm, or one beyond the fence, if no other was found."""
        if s.report is None or not self._has_lasted(s):
            return
        if self._asked_ns is not None and 0 <= s.now_ns - self._asked_ns < ASK_AGAIN_NS:
            return
        zone = confirmable(s.report.zones, self._p, partial(self._fenced.is_inside, s))
        if zone is not None:
            self._asked_ns = s.now_ns
            self._texts.say(Severity.WARNING, f"zone {zone.id}: {zone.best.surface.text}: confirm")
            return
        zone = choose(s.report.zones, self._progress.refused, self._p)
        outside = "" if zone is None else beyond_fence(s, self._p, zone.best.enu_m, zone.id)
        if outside:
            self._asked_ns = s.now_ns
            self._texts.say(Severity.WARNING, f"{outside} beyond the fence")

    def search_time(self, s: Situation) -> VehicleCommands | None:
        """Hover and call the pilot after a long search."""
        if s.now_ns - self._progress.since_ns <= round(self._p.survey_s * 1e9) + SEARCH_NS:
            return None
        self._texts.say(Severity.CRITICAL, "no zone found: take over")
        self._transitions.enter_phase(Phase.HOLD, s)
        return VehicleCommands(velocity_enu_ms=STOPPED)

    def look_aside(self, s: Situation) -> VehicleCommands | None:
        """Look from aside at ground below that may be water and is no zone."""
        offset = self._aside_offset(s)
        return None if offset is None else self._route.commands_towards(s, offset, self._p.approach_speed_ms)

    def corner(self, s: Situation) -> VehicleCommands:
        """Fly to the next corner of the search."""
        way = self._route.reported_way(s, self._texts)
        offset = self._route.to_corner(known(s.position_enu_m), way, s.fence)
        return self._route.commands_towards(s, offset, self._p.survey_speed_ms)

    def _choice(self, s: Situation) -> Zone | None:
        """Return the zone to fly to once the survey has lasted: a near one, else one to be looked at.

        The latter is a zone of the far map, or of the survey prior.
        """
        progress, p = self._progress, self._p
        if s.report is None or not (progress.is_urgent or self._has_lasted(s)):
            return None
        if progress.is_urgent:
            return self._soonest.zone(s)
        drift_m, inside = gust_drift_m(s.wind), partial(self._fenced.is_inside, s)
        return (
            choose(s.report.zones, progress.refused, p, drift_m, inside)
            or choose(s.report.far.zones, progress.refused, p, drift_m, inside)
            or look_at(s.report, progress.refused, p, inside)
        )

    def _has_lasted(self, s: Situation) -> bool:
        return s.now_ns - self._progress.since_ns >= self._p.survey_s * 1e9

    def _aside_offset(self, s: Situation) -> Vector | None:
        """Return the offset (2,) of the look from aside, None without one."""
        if s.report is None or not self._has_lasted(s):
            return None
        if self._looked_since_ns != self._progress.since_ns:
            self._looked_since_ns = self._progress.since_ns
            self._looked.clear()
            self._aside.reset()
        height_m = s.report.choice.height_m
        if self._aside.is_under_way:
            return self._aside.offset(s, *self._looked[-1], height_m)
        position = known(s.position_enu_m)
        row, col = s.report.grid.index(float(position[0]), float(position[1]))
        if len(self._looked) == MOST_LOOKS or any(zone.holds(row, col) for zone in s.report.zones):
            return None
        if any(np.hypot(*(position - place)[:2]) < APART_M for place, _ in self._looked):
            return None
        self._aside.reset()
        offset = self._aside.offset(s, position.copy(), s.below, height_m)
        if offset is not None:
            self._looked.append((position.copy(), s.below))
        return offset
