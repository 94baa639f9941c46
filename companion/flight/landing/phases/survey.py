"""Phase survey: fly an expanding square until a zone can be chosen."""

from __future__ import annotations

from functools import partial

import numpy as np

from companion.flight.landing.interruptions.missing_input import without_lidar
from companion.flight.landing.landing_state import SECOND, LandingState
from companion.flight.landing.looks.oblique_look import ObliqueLook
from companion.flight.landing.phases.approach import Approach
from companion.flight.landing.situation import (
    STOPPED,
    Phase,
    Severity,
    Situation,
    Vector,
    VehicleCommands,
    known,
)
from companion.flight.landing.wind.gust_drift import gust_drift_m
from companion.flight.landing.zone_choice import choose, confirmable, look_at
from slz import SurfaceHere, Zone

SEARCH_NS = 300 * SECOND  # beyond `survey_s`, before the pilot is called
ASK_AGAIN_NS = 30 * SECOND  # for the confirmation of a zone
MOST_LOOKS, APART_M = 3, 50.0  # from aside, in one survey, and between them
TAKE_OVER_NS = 5 * SECOND  # limit for the autopilot to obey an emergency


class Survey:
    """Searches for a zone and hands it to the approach."""

    def __init__(self, state: LandingState, approach: Approach) -> None:
        self._state, self._approach = state, approach
        self._asked_ns: int | None = None
        self._aside = ObliqueLook(state)
        self._looked: list[tuple[Vector, SurfaceHere]] = []  # places in this survey, and their surface then
        self._looked_since_ns = 0

    def commands(self, s: Situation) -> VehicleCommands:
        """Fly to the next corner of the search, or approach the zone that is chosen now."""
        state = self._state
        if not s.guided:
            return self.take_over(s)
        if not state.route.begun:
            state.start_survey(s)
            return VehicleCommands(velocity_enu_ms=STOPPED)
        if not s.lidar_ok:
            return without_lidar(state, s)
        state.outage.on_present(s.now_ns)
        if state.too_windy(s) and (
            self._has_lasted(s) or (state.request and state.request.enu_m is not None)
        ):
            return self._wait_for_less_wind(s)
        if state.request is not None and state.request.enu_m is not None:
            return self._approach.start(s, state.request.enu_m, state.request.zone_id)
        zone = self._choice(s)
        if zone is not None:
            return self._approach.start(s, zone.best.enu_m, zone.id)
        self._ask(s)
        if s.now_ns - state.since_ns > round(state.parameters.survey_s * 1e9) + SEARCH_NS:
            state.say(Severity.CRITICAL, "no zone found: take over")
            state.go(Phase.HOLD, s)
            return VehicleCommands(velocity_enu_ms=STOPPED)
        position = known(s.position_enu_m)
        aside = self._look_aside(s)
        if aside is not None:
            return state.route.commands_towards(s, aside, state.parameters.approach_speed_ms)
        offset = state.route.to_corner(position, state.way(s), s.fence)
        return state.route.commands_towards(s, offset, state.parameters.survey_speed_ms)

    def take_over(self, s: Situation) -> VehicleCommands:
        """Request the guided mode after an emergency order; give up if the autopilot refuses."""
        if s.now_ns - self._state.started_ns > TAKE_OVER_NS:
            self._state.say(Severity.CRITICAL, f"{s.mode} stays: not landing")
            self._state.rest(Phase.IDLE, s)
            return VehicleCommands()
        return VehicleCommands(mode="guided", velocity_enu_ms=STOPPED)

    def _wait_for_less_wind(self, s: Situation) -> VehicleCommands:
        """Hover; the time to search for a zone begins when the wind is less."""
        self._state.report_wind(s)
        self._state.end_survey(s)
        return VehicleCommands(velocity_enu_ms=STOPPED)

    def _choice(self, s: Situation) -> Zone | None:
        """Return the zone to fly to once the survey has lasted: a near one, else one to be looked at.

        The latter is a zone of the far map, or of the survey prior.
        """
        state, p = self._state, self._state.parameters
        if s.report is None or not (state.is_urgent or self._has_lasted(s)):
            return None
        if state.is_urgent:
            return state.soonest_zone(s)
        drift_m = gust_drift_m(s.wind)
        inside = partial(state.is_inside_fence, s)
        return (
            choose(s.report.zones, state.refused, p, drift_m, inside)
            or choose(s.report.far.zones, state.refused, p, drift_m, inside)
            or look_at(s.report, state.refused, p, inside)
        )

    def _has_lasted(self, s: Situation) -> bool:
        return s.now_ns - self._state.since_ns >= self._state.parameters.survey_s * 1e9

    def _look_aside(self, s: Situation) -> Vector | None:
        """Return the offset (2,) of a look from aside at ground below that may be water and is no zone."""
        if s.report is None or not self._has_lasted(s):
            return None
        if self._looked_since_ns != self._state.since_ns:
            self._looked_since_ns = self._state.since_ns
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

    def _ask(self, s: Situation) -> None:
        """Tell the pilot now and then of a zone to confirm, or beyond the fence, if no other was found."""
        if s.report is None or not self._has_lasted(s):
            return
        if self._asked_ns is not None and 0 <= s.now_ns - self._asked_ns < ASK_AGAIN_NS:
            return
        state = self._state
        zone = confirmable(s.report.zones, state.parameters, partial(state.is_inside_fence, s))
        if zone is not None:
            self._asked_ns = s.now_ns
            state.say(Severity.WARNING, f"zone {zone.id}: {zone.best.surface.text}: confirm")
            return
        zone = choose(s.report.zones, state.refused, state.parameters)
        outside = "" if zone is None else state.beyond_fence(s, zone.best.enu_m, zone.id)
        if outside:
            self._asked_ns = s.now_ns
            state.say(Severity.WARNING, f"{outside} beyond the fence")
