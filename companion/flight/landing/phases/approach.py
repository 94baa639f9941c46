"""Phase approach: fly over the point, look from aside or closer, and turn.

When the vehicle has been over the point, and the point safe, for two seconds, it goes straight down, or out
to where its approach path begins.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from companion.flight.landing.check_order import Check
from companion.flight.landing.fenced_zones import aim_is_beyond_fence
from companion.flight.landing.interruptions.missing_input import MissingInputs
from companion.flight.landing.looks.closer_look import LOOK_MS, CloserLook
from companion.flight.landing.looks.oblique_look import ObliqueLook
from companion.flight.landing.orders.confirmation import ground_at, must_be_confirmed, unconfirmed
from companion.flight.landing.point_objections import cause_suffix, may_be_water, water_suffix
from companion.flight.landing.route import TURN_M, Route, Way
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
from companion.flight.landing.transitions import SECOND, LandingCore
from companion.flight.landing.ways.fly_out import FlyOut
from companion.flight.landing.wind.landing_wind import LandingWind
from slz import PointState, SurfaceHere, SurfaceKind

REFUSED_NS = 3 * SECOND  # called unsafe by every report: rays contradict an echo of clutter sooner
STEADY_NS = 2 * SECOND  # point safe before the descent
UNSEEN_NS = 30 * SECOND  # over a point that stays unknown
WATER_NS = 5 * SECOND  # over a point that stays unknown because it may be water, after the look from aside
TURN_NS = 15 * SECOND  # over a safe point, to turn into the wind; afterwards any safe heading will do
OVER_M, OVER_MS = 1.0, 0.5  # distance and speed of a vehicle that is over the point


class Approach:
    """Flies to a point at the height of the route."""

    def __init__(
        self, core: LandingCore, route: Route, wind: LandingWind, missing_inputs: MissingInputs
    ) -> None:
        self.checks: tuple[Check, ...] = (
            self.scans, self.arrival, self.point_unsafe, self.fence, self.surface, self.obstacle,
            self.time_limit, self.fly_out, self.way_down, self.point_unseen, self.way_over,
        )  # fmt: skip
        self._p, self._progress, self._texts, self._transitions = core
        self._route, self._wind, self._missing_inputs = route, wind, missing_inputs
        self._aside = ObliqueLook(self._p, self._progress, self._texts)
        self._closer = CloserLook(self._p, self._progress, self._texts)
        self._out = FlyOut(self._p, self._progress, self._texts, route)
        self._look: tuple[Vector | None, float] = None, math.inf  # of this step
        self._over_since_ns: int | None = None  # over the point, in this approach
        self._standing_since_ns: int | None = None  # over the safe point, at a safe heading
        self._warned = False  # of the surface
        self._refused_ns: int | None = None  # stamp of the first report that calls the point unsafe

    def start(self, s: Situation, enu_m: Vector, zone_id: int | None) -> VehicleCommands:
        """Choose a point and turn to it."""
        progress = self._progress
        self._transitions.aim_at(s, enu_m)
        progress.tally.zone_id = zone_id
        self._over_since_ns = self._standing_since_ns = progress.safe_since_ns = None
        self._aside.reset()
        self._closer.reset()
        self._out.reset()
        progress.path = None
        self._warned, self._refused_ns = False, None
        ground = ground_at(s, known(progress.aim.enu_m), zone_id)
        named = ground if zone_id is not None else replace(ground, zone_id=None)
        self._texts.say(Severity.INFO, f"approaching {named.text}")
        self._warn_of(ground.surface)
        self._transitions.enter_phase(Phase.APPROACH, s)
        return VehicleCommands(velocity_enu_ms=STOPPED)

    def scans(self, s: Situation) -> VehicleCommands | None:
        """Hold without scans."""
        if not s.lidar_ok:
            return self._missing_inputs.without_lidar(s)
        self._missing_inputs.on_present(s)
        return None

    def arrival(self, s: Situation) -> None:
        """Record the first time over the point."""
        if self._is_over(s) and self._over_since_ns is None:
            self._over_since_ns = s.now_ns

    def point_unsafe(self, s: Situation) -> VehicleCommands | None:
        """Break off at a point that all reports of three seconds call unsafe."""
        if not self._is_refused(s, self._progress.aim.judgement(s.selected)):
            return None
        reason = "point unsafe" + cause_suffix(s, self._progress, self._p)
        return self._transitions.break_off(reason, s)

    def fence(self, s: Situation) -> VehicleCommands | None:
        """Break off at a point that the fence excludes."""
        if not aim_is_beyond_fence(s, self._progress, self._p):
            return None
        return self._transitions.break_off("point beyond the fence", s)

    def surface(self, s: Situation) -> VehicleCommands | None:
        """Break off over ground that lacks its confirmation; warn of it in an emergency."""
        surface = unconfirmed(s, self._progress, self._p)
        if surface is not None:
            return self._transitions.break_off(f"{surface}: not confirmed", s)
        if s.selected is not None and self._progress.aim.is_at(s.selected):
            self._warn_of(s.selected.surface)
        return None

    def obstacle(self, s: Situation) -> VehicleCommands | None:
        """Climb over an obstacle ahead; break off before one that is too high."""
        too_high = self._route.reported_way(s, self._texts) is Way.TOO_HIGH
        return self._transitions.break_off("way blocked", s) if too_high else None

    def time_limit(self, s: Situation) -> VehicleCommands | None:
        """Break off where the point is not reached in time."""
        late = s.now_ns > self._progress.late_ns
        return self._transitions.break_off("point not reached", s) if late else None

    def fly_out(self, s: Situation) -> VehicleCommands | None:
        """Fly to the beginning of the approach path that was chosen, and along it from there."""
        return None if self._out.path is None else self._fly_out(s)

    def way_down(self, s: Situation) -> VehicleCommands | None:
        """Look at the point, turn, and begin the descent over a point that stays safe."""
        progress, over = self._progress, self._is_over(s)
        judged = progress.aim.judgement(s.selected)
        self._look = look, _ = self._next_look(s, judged)
        if look is not None:
            self._over_since_ns = s.now_ns
        stands = judged is PointState.SAFE and stands_at(s.selected, s.heading_rad)
        turned = self._is_turned(s, look is None and over and stands)
        if look is not None or not (over and stands and turned):
            progress.safe_since_ns = None
        elif progress.safe_since_ns is None:
            progress.safe_since_ns = s.now_ns
        elif s.now_ns - progress.safe_since_ns > STEADY_NS:
            if not self._out.begin(s):
                return self._transitions.break_off("no way in", s)
            if self._out.goes_down:
                turned = is_turned(s.selected, s.heading_rad, self._wind.into_wind.heading_rad)
                self._texts.say(Severity.INFO, "descending" if turned else "descending, not into the wind")
                self._transitions.enter_phase(Phase.DESCEND, s)
        return None

    def point_unseen(self, s: Situation) -> VehicleCommands | None:
        """Break off at a point that stays unknown from above."""
        patience_ns = WATER_NS if may_be_water(s, self._progress, self._p) else UNSEEN_NS
        unseen = self._over_since_ns is not None and s.now_ns - self._over_since_ns > patience_ns
        unknown = self._progress.aim.judgement(s.selected) is PointState.UNKNOWN
        if not (self._is_over(s) and unknown and unseen):
            return None
        return self._transitions.break_off("point not seen" + water_suffix(s, self._progress, self._p), s)

    def way_over(self, s: Situation) -> VehicleCommands:
        """Fly the look, or towards the point, and turn near it."""
        aim, speed_ms = self._progress.aim, self._p.approach_speed_ms
        look, look_ms = self._look
        if look is not None:
            return self._route.commands_towards(s, look, min(look_ms, speed_ms))
        offset = known(aim.enu_m)[:2] - known(s.position_enu_m)[:2]
        commands = self._route.commands_towards(s, offset, speed_ms)
        if aim.away_m < TURN_M and aim.judgement(s.selected) is PointState.SAFE:
            into_wind_rad = self._wind.into_wind.heading_rad
            return replace(commands, yaw_rad=touchdown_heading_rad(s.selected, s.heading_rad, into_wind_rad))
        return commands

    def _is_over(self, s: Situation) -> bool:
        slow = float(np.hypot(*known(s.velocity_enu_ms)[:2])) < OVER_MS
        return self._progress.aim.away_m < OVER_M and slow

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

    def _fly_out(self, s: Situation) -> VehicleCommands | None:
        """Fly to the beginning of the approach path, and along it from there; None once it is given up."""
        offset = self._out.offset(s)
        path = self._out.path
        if offset is not None:
            return self._route.commands_towards(s, offset, self._p.approach_speed_ms)
        self._over_since_ns = self._standing_since_ns = self._progress.safe_since_ns = None
        if path is None:  # back over the point, to choose again
            self._transitions.restart_limit(s)
            return None
        self._progress.path = path
        self._texts.say(
            Severity.INFO, f"way in from {path.bearing_deg:.0f} deg, {path.slope_deg:.0f} deg steep"
        )
        self._transitions.enter_phase(Phase.DESCEND, s)
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
        return late or is_turned(s.selected, s.heading_rad, self._wind.into_wind.heading_rad)

    def _next_look(self, s: Situation, judged: PointState) -> tuple[Vector | None, float]:
        """Return the offset (2,) and the greatest speed of a look at the point, which it was over before."""
        aim = self._progress.aim
        if self._over_since_ns is None:
            return None, math.inf
        if s.selected is not None and aim.is_at(s.selected):
            target = aim.on_ground_enu_m
            aside = self._aside.offset(s, target, s.selected.surface, aim.height_left_m)
            if aside is not None:
                return aside, math.inf
        return self._closer.offset(s) if judged is PointState.SAFE else None, LOOK_MS

    def _warn_of(self, surface: SurfaceHere) -> None:
        """Warn once of ground that only an urgent landing takes without a confirmation."""
        if self._warned or not self._progress.is_urgent or not must_be_confirmed(surface, self._p):
            return
        self._warned = True
        article = "a " if surface.kind is SurfaceKind.ROOF else ""
        self._texts.say(Severity.WARNING, f"landing on {article}{surface.text}")
