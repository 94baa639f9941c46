"""Phase approach: fly over the point, look from aside or closer, and turn.

When the vehicle has been over the point, and the point safe, for two seconds, it goes straight down, or out
to where its approach path begins.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from companion.flight.landing.confirmation import ground_at
from companion.flight.landing.interruptions.missing_input import without_lidar
from companion.flight.landing.landing_state import SECOND, LandingState
from companion.flight.landing.looks.closer_look import LOOK_MS, CloserLook
from companion.flight.landing.looks.oblique_look import ObliqueLook
from companion.flight.landing.route import TURN_M, Way
from companion.flight.landing.situation import (
    STOPPED,
    Phase,
    Severity,
    Situation,
    Vector,
    VehicleCommands,
    known,
)
from companion.flight.landing.touchdown_heading import is_turned, stands_at, touchdown_heading_rad
from companion.flight.landing.ways.fly_out import FlyOut
from companion.flight.landing.zone_choice import must_be_confirmed
from slz import PointState, SurfaceHere, SurfaceKind

REFUSED_NS = 3 * SECOND  # called unsafe by every report: rays contradict an echo of clutter sooner
STEADY_NS = 2 * SECOND  # point safe before the descent
UNSEEN_NS = 30 * SECOND  # over a point that stays unknown
WATER_NS = 5 * SECOND  # over a point that stays unknown because it may be water, after the look from aside
TURN_NS = 15 * SECOND  # over a safe point, to turn into the wind; afterwards any safe heading will do
OVER_M, OVER_MS = 1.0, 0.5  # distance and speed of a vehicle that is over the point


class Approach:
    """Flies to a point at the height of the route."""

    def __init__(self, state: LandingState) -> None:
        self._state = state
        self._aside, self._closer = ObliqueLook(state), CloserLook(state)
        self._out = FlyOut(state)
        self._over_since_ns: int | None = None  # over the point, in this approach
        self._standing_since_ns: int | None = None  # over the safe point, at a safe heading
        self._warned = False  # of the surface
        self._refused_ns: int | None = None  # stamp of the first report that calls the point unsafe

    def start(self, s: Situation, enu_m: Vector, zone_id: int | None) -> VehicleCommands:
        """Choose a point and turn to it."""
        state = self._state
        state.aim.set_target(enu_m)
        state.aim.measure(s.position_enu_m, s.selected)
        state.tally.zone_id, state.tally.chosen_enu_m = zone_id, state.aim.enu_m
        state.selection.select(state.aim.enu_m)
        self._over_since_ns = self._standing_since_ns = state.safe_since_ns = None
        self._aside.reset()
        self._closer.reset()
        self._out.reset()
        state.path = None
        self._warned, self._refused_ns = False, None
        ground = ground_at(s, known(state.aim.enu_m), zone_id)
        named = ground if zone_id is not None else replace(ground, zone_id=None)
        state.say(Severity.INFO, f"approaching {named.text}")
        self._warn_of(ground.surface)
        state.go(Phase.APPROACH, s)
        return VehicleCommands(velocity_enu_ms=STOPPED)

    def commands(self, s: Situation) -> VehicleCommands:
        """Fly towards the point; descend, or break off with the reason."""
        state = self._state
        position, velocity = known(s.position_enu_m), known(s.velocity_enu_ms)
        if not s.lidar_ok:
            return without_lidar(state, s)
        state.outage.on_present(s.now_ns)
        judged = state.aim.judgement(s.selected)
        offset = known(state.aim.enu_m)[:2] - position[:2]
        over = state.aim.away_m < OVER_M and float(np.hypot(*velocity[:2])) < OVER_MS
        if over and self._over_since_ns is None:
            self._over_since_ns = s.now_ns
        if self._is_refused(s, judged):
            return state.break_off("point unsafe" + state.cause_suffix(s), s)
        if state.aim_is_beyond_fence(s):
            return state.break_off("point beyond the fence", s)
        unconfirmed = state.unconfirmed(s)
        if unconfirmed is not None:
            return state.break_off(f"{unconfirmed}: not confirmed", s)
        if s.selected is not None and state.aim.is_at(s.selected):
            self._warn_of(s.selected.surface)
        if state.way(s) is Way.TOO_HIGH:
            return state.break_off("way blocked", s)
        if s.now_ns > state.late_ns:
            return state.break_off("point not reached", s)
        if self._out.path is not None:
            commands = self._fly_out(s)
            if commands is not None:
                return commands
        look, look_ms = self._look(s, judged)
        if look is not None:
            self._over_since_ns = s.now_ns
        stands = judged is PointState.SAFE and stands_at(s.selected, s.heading_rad)
        turned = self._is_turned(s, look is None and over and stands)
        if look is not None or not (over and stands and turned):
            state.safe_since_ns = None
        elif state.safe_since_ns is None:
            state.safe_since_ns = s.now_ns
        elif s.now_ns - state.safe_since_ns > STEADY_NS:
            if not self._out.begin(s):
                return state.break_off("no way in", s)
            if self._out.goes_down:
                turned = is_turned(s.selected, s.heading_rad, state.into_wind.heading_rad)
                state.say(Severity.INFO, "descending" if turned else "descending, not into the wind")
                state.go(Phase.DESCEND, s)
        patience_ns = WATER_NS if state.may_be_water(s) else UNSEEN_NS
        unseen = self._over_since_ns is not None and s.now_ns - self._over_since_ns > patience_ns
        if over and judged is PointState.UNKNOWN and unseen:
            return state.break_off("point not seen" + state.water_suffix(s), s)
        speed_ms = state.parameters.approach_speed_ms
        if look is not None:
            return state.route.commands_towards(s, look, min(look_ms, speed_ms))
        commands = state.route.commands_towards(s, offset, speed_ms)
        if state.aim.away_m < TURN_M and judged is PointState.SAFE:
            into_wind_rad = state.into_wind.heading_rad
            return replace(commands, yaw_rad=touchdown_heading_rad(s.selected, s.heading_rad, into_wind_rad))
        return commands

    def _is_refused(self, s: Situation, judged: PointState) -> bool:
        """Return whether all reports of three seconds call the point unsafe.

        From high above it a few returns may err, and later rays prove it within seconds.
        """
        if judged is not PointState.UNSAFE or s.report is None:
            self._refused_ns = None
            return False
        if self._refused_ns is None:
            self._refused_ns = s.report.stamp_ns
        return s.report.stamp_ns - self._refused_ns >= REFUSED_NS

    def descend_at_once(self, s: Situation) -> VehicleCommands | None:
        """Descend over a safe point without waiting; None if the vehicle is not ready to go straight down."""
        state = self._state
        sloped = state.parameters.approach_path == "sloped" and not state.is_urgent
        if state.safe_since_ns is None or sloped or state.why_not(s) is not None:
            return None
        state.go(Phase.DESCEND, s)
        return VehicleCommands(velocity_enu_ms=STOPPED, target_enu_m=state.aim.on_ground_enu_m)

    def _fly_out(self, s: Situation) -> VehicleCommands | None:
        """Fly to the beginning of the approach path, and along it from there; None once it is given up."""
        state, speed_ms = self._state, self._state.parameters.approach_speed_ms
        offset = self._out.offset(s)
        path = self._out.path
        if offset is not None:
            return state.route.commands_towards(s, offset, speed_ms)
        self._over_since_ns = self._standing_since_ns = state.safe_since_ns = None
        if path is None:  # back over the point, to choose again
            state.restart_limit(s)
            return None
        state.path = path
        state.say(Severity.INFO, f"way in from {path.bearing_deg:.0f} deg, {path.slope_deg:.0f} deg steep")
        state.go(Phase.DESCEND, s)
        return VehicleCommands(velocity_enu_ms=STOPPED, yaw_rad=path.inbound_rad)

    def _is_turned(self, s: Situation, stands: bool) -> bool:
        """Return whether the vehicle has its touchdown heading, or had time enough to turn to it.

        stands: it is over the safe point at a heading at which its gear stands.
        """
        if not stands:
            self._standing_since_ns = None
        elif self._standing_since_ns is None:
            self._standing_since_ns = s.now_ns
        since_ns = self._standing_since_ns
        late = since_ns is not None and s.now_ns - since_ns > TURN_NS
        return late or is_turned(s.selected, s.heading_rad, self._state.into_wind.heading_rad)

    def _look(self, s: Situation, judged: PointState) -> tuple[Vector | None, float]:
        """Return the offset (2,) and the greatest speed of a look at the point, which it was over before."""
        state = self._state
        if self._over_since_ns is None:
            return None, math.inf
        if s.selected is not None and state.aim.is_at(s.selected):
            target = state.aim.on_ground_enu_m
            aside = self._aside.offset(s, target, s.selected.surface, state.aim.height_left_m)
            if aside is not None:
                return aside, math.inf
        return self._closer.offset(s) if judged is PointState.SAFE else None, LOOK_MS

    def _warn_of(self, surface: SurfaceHere) -> None:
        """Warn once of ground that only an urgent landing takes without a confirmation."""
        state = self._state
        if self._warned or not state.is_urgent or not must_be_confirmed(surface, state.parameters):
            return
        self._warned = True
        article = "a " if surface.kind is SurfaceKind.ROOF else ""
        state.say(Severity.WARNING, f"landing on {article}{surface.text}")
