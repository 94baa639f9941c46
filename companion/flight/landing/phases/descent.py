"""Phases descend and final: sink over the point, or along an approach path, then watch the autopilot land."""

from __future__ import annotations

import numpy as np

from companion.flight.landing.aim import committed_m
from companion.flight.landing.check_order import Check, decided
from companion.flight.landing.guidance import level, towards
from companion.flight.landing.interruptions.crossing import CrossingWait
from companion.flight.landing.interruptions.gps_loss import WithoutGps
from companion.flight.landing.outage import GpsLoss
from companion.flight.landing.point_objections import objection, wire_suffix
from companion.flight.landing.situation import (
    STOPPED,
    Phase,
    Severity,
    Situation,
    Vector,
    VehicleCommands,
    known,
)
from companion.flight.landing.touchdown_heading import stands_at, touchdown_heading_rad
from companion.flight.landing.transitions import SECOND, LandingCore
from companion.flight.landing.ways.approach_path import ApproachPath
from companion.flight.landing.wind.landing_wind import LandingWind
from slz import PointState

TARGET_NS = round(2.5 * SECOND)  # landing target streamed before LAND, for the autopilot's estimator
REQUEST_AGAIN_NS = SECOND  # a request for LAND that shows no effect was refused, or lost on the way
RESUMED_NS = 8 * SECOND  # a resumed landing may sink this long before its point must be seen safe
SINK_WITHIN_M, LAND_WITHIN_M = 1.5, 0.7  # horizontal distance to the point for sinking, and for LAND
TURN_FROM_M = 10.0  # from the point, on an approach path: nearer the vehicle turns to its touchdown heading
TARGET_FROM_M = 15.0  # from the point, on an approach path: nearer the landing target is streamed
HOVERS_WITHIN_M = 1.0  # of the height at the end of an approach path
BLOCKED_NS = SECOND  # something ahead on an approach path, before the landing is broken off
BRAKING_S = 2.0  # of sinking above the commit height, for the change to LAND in a hurry
BELOW_FINAL_M = 1.0  # the descent's floor below `final_height_m`: the vehicle does not slow down before LAND


class Descent:
    """Descends to `final_height_m` and hands over to the autopilot's landing mode."""

    def __init__(
        self, core: LandingCore, wind: LandingWind, gps_loss: GpsLoss, without_gps: WithoutGps
    ) -> None:
        self.checks: tuple[Check, ...] = (
            self.object_without_gps, self.crossing, self.point, self.time_limit, self.moving_in,
            self.approach_path, self.land_mode, self.sink,
        )  # fmt: skip
        self.final_checks: tuple[Check, ...] = (
            self.object_without_gps, self.crossing, self.point, self.heading, self.landing_time,
            self.moving_in, self.land_again, self.target,
        )  # fmt: skip
        self._p, self._progress, self._texts, self._transitions = core
        self._wind, self._gps_loss, self._without_gps = wind, gps_loss, without_gps
        self._wait = CrossingWait(core)
        self._resumed_until_ns = 0
        self._near_since_ns: int | None = None  # on an approach path: the landing target is streamed
        self._free_ns = 0  # on an approach path: last time at which nothing was ahead

    @property
    def waits(self) -> bool:
        """True if the vehicle holds while somebody crosses the point."""
        return self._wait.is_on

    def resume(self, s: Situation, enu_m: Vector) -> None:
        """Resume watching the autopilot's landing at a point, which was begun before a restart or silence."""
        self._transitions.resume_landing(s, enu_m)
        self._resumed_until_ns = s.now_ns + RESUMED_NS

    def resume_after_restart(self, s: Situation, enu_m: Vector) -> None:
        """Report the restart, and resume watching the autopilot's landing at a point."""
        self._texts.say(Severity.WARNING, f"restarted in {s.mode}: watching the landing again")
        self.resume(s, enu_m)

    def final_commands(self, s: Situation) -> VehicleCommands:
        """Watch the autopilot land; break off if the point turns unsafe while it can be seen."""
        return decided(self.final_checks, s)

    def object_without_gps(self, s: Situation) -> VehicleCommands | None:
        """Hover without GPS where something came onto the point."""
        if not self._gps_loss.is_on:
            return None
        self._wait.reset()
        return self._without_gps.stop_for_object(s)

    def crossing(self, s: Situation) -> VehicleCommands | None:
        """Wait for somebody who crosses."""
        return None if self._last_state_holds else self._wait.commands(s)

    def point(self, s: Situation) -> VehicleCommands | None:
        """Break off where something speaks against the point or the way down."""
        if self._last_state_holds or self._is_unseen(s):
            return None
        reason = objection(s, self._progress, self._p)
        return self._transitions.break_off(reason, s) if reason else None

    def heading(self, s: Situation) -> VehicleCommands | None:
        """Break off at a heading at which the gear does not stand."""
        if self._last_state_holds or self._is_unseen(s) or stands_at(s.selected, s.heading_rad):
            return None
        return self._transitions.break_off("heading unsafe", s)

    def time_limit(self, s: Situation) -> VehicleCommands | None:
        """Break off a descent that takes too long."""
        late = s.now_ns > self._progress.late_ns and not self._last_state_holds
        return self._transitions.break_off("point not reached", s) if late else None

    def landing_time(self, s: Situation) -> VehicleCommands | None:
        """Break off a landing that takes too long; below the commit height call the pilot."""
        if s.now_ns <= self._progress.late_ns:
            return None
        if not self._last_state_holds:
            return self._transitions.break_off("does not land", s)
        self._transitions.call_pilot("not landing", s)
        return None

    def moving_in(self, s: Situation) -> VehicleCommands | None:
        """Give way to what will be at the point at the touchdown."""
        return None if self._last_state_holds or self._is_unseen(s) else self._wait.give_way(s)

    def approach_path(self, s: Situation) -> VehicleCommands | None:
        """Fly down the approach path, where there is one."""
        path = self._progress.path
        return None if path is None else self._on_path(path, s)

    def land_mode(self, s: Situation) -> VehicleCommands | None:
        """Change to the autopilot's landing, low and steady over the point."""
        progress, aim = self._progress, self._progress.aim
        steady = self._stands(s) and s.now_ns - progress.since_ns > TARGET_NS
        low = aim.height_left_m <= self._final_m or not self._gps_loss.still_guides(s.now_ns)
        return self._land(s) if low and steady and aim.away_m < LAND_WITHIN_M else None

    def sink(self, s: Situation) -> VehicleCommands:
        """Fly over the point, and sink there."""
        aim, p = self._progress.aim, self._p
        floor = self._final_m - BELOW_FINAL_M - aim.height_left_m
        sinks = self._stands(s) and aim.away_m < SINK_WITHIN_M
        sink = level(min(0.0, floor), p.descent_speed_ms) if sinks else 0.0
        target = aim.on_ground_enu_m
        offset = target[:2] - known(s.position_enu_m)[:2]
        horizontal = towards(offset, p.approach_speed_ms, known(s.velocity_enu_ms))
        heading = touchdown_heading_rad(s.selected, s.heading_rad, self._wind.into_wind.heading_rad)
        return VehicleCommands(
            velocity_enu_ms=np.array([*horizontal, sink]), yaw_rad=heading, target_enu_m=target
        )

    def land_again(self, s: Situation) -> VehicleCommands | None:
        """Request LAND again where the guided mode stays, and stop the vehicle's last setpoint too."""
        if not s.guided or s.now_ns - self._progress.since_ns <= REQUEST_AGAIN_NS:
            return None
        target = self._progress.aim.on_ground_enu_m
        return VehicleCommands(mode="land", velocity_enu_ms=STOPPED, target_enu_m=target)

    def target(self, _s: Situation) -> VehicleCommands:
        """Stream the landing target."""
        return VehicleCommands(target_enu_m=self._progress.aim.on_ground_enu_m)

    @property
    def _last_state_holds(self) -> bool:
        """True if the last verified state of the point holds: in final too low to see it, or without GPS."""
        too_low = self._progress.phase is Phase.FINAL and self._progress.aim.is_low(self._p)
        return too_low or self._gps_loss.is_on

    def _is_unseen(self, s: Situation) -> bool:
        """Return whether a resumed landing has not seen its point yet, and may still sink."""
        unknown = not s.lidar_ok or self._progress.aim.judgement(s.selected) is PointState.UNKNOWN
        return self._progress.phase is Phase.FINAL and unknown and s.now_ns < self._resumed_until_ns

    @property
    def _final_m(self) -> float:
        """Height over the point for the change to LAND; without GPS as low as it can still slow down."""
        p = self._p
        lowest_m = committed_m(p) + BRAKING_S * p.descent_speed_ms
        return min(p.final_height_m, lowest_m) if self._gps_loss.is_on else p.final_height_m

    def _land(self, s: Situation) -> VehicleCommands:
        self._texts.say(Severity.INFO, "final: LAND")
        self._transitions.enter_phase(Phase.FINAL, s)
        return VehicleCommands(mode="land", target_enu_m=self._progress.aim.on_ground_enu_m)

    def _stands(self, s: Situation) -> bool:
        """Return whether the gear stands at this heading; without GPS that of the descent's begin counts."""
        return self._gps_loss.is_on or stands_at(s.selected, s.heading_rad)

    def _on_path(self, path: ApproachPath, s: Situation) -> VehicleCommands:
        """Fly down an approach path, and hand over to LAND from the hover at its end."""
        progress, aim, without_gps = self._progress, self._progress.aim, self._gps_loss.is_on
        away_m, target = aim.away_m, aim.on_ground_enu_m
        if not s.blocked or s.now_ns - progress.since_ns < BLOCKED_NS or without_gps:
            self._free_ns = s.now_ns
        if s.now_ns - self._free_ns >= BLOCKED_NS:
            return self._transitions.break_off("way in blocked" + wire_suffix(s, progress, self._p), s)
        if away_m > TARGET_FROM_M or self._near_since_ns is None or self._near_since_ns < progress.since_ns:
            self._near_since_ns = s.now_ns
        stands = self._stands(s)
        down = aim.height_left_m <= path.hover_m + HOVERS_WITHIN_M or without_gps
        if down and away_m < LAND_WITHIN_M and stands and s.now_ns - self._near_since_ns > TARGET_NS:
            return self._land(s)
        yaw_rad: float | None = path.inbound_rad
        if away_m < TURN_FROM_M:
            yaw_rad = touchdown_heading_rad(s.selected, s.heading_rad, self._wind.into_wind.heading_rad)
        position, velocity = known(s.position_enu_m), known(s.velocity_enu_ms)
        return VehicleCommands(
            velocity_enu_ms=path.velocity_enu_ms(position, velocity, target, self._p),
            yaw_rad=yaw_rad,
            target_enu_m=target if away_m <= TARGET_FROM_M else None,
        )
