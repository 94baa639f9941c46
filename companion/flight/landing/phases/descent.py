"""Phases descend and final: sink over the point, or along an approach path, then watch the autopilot land."""

from __future__ import annotations

import numpy as np

from companion.flight.landing.guidance import level, towards
from companion.flight.landing.interruptions.crossing_wait import CrossingWait
from companion.flight.landing.landing_state import SECOND, LandingState
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
from companion.flight.landing.ways.approach_path import ApproachPath
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

    def __init__(self, state: LandingState) -> None:
        self._state = state
        self._resumed_until_ns = 0
        self._near_since_ns: int | None = None  # on an approach path: the landing target is streamed
        self._free_ns = 0  # on an approach path: last time at which nothing was ahead
        self._wait = CrossingWait(state)

    @property
    def waits(self) -> bool:
        """Whether the vehicle holds while somebody crosses the point."""
        return self._wait.is_on

    def watch_again(self, s: Situation) -> VehicleCommands:
        """Watch a landing again that the autopilot was not made to leave in time."""
        state = self._state
        if s.position_enu_m is None or state.aim.enu_m is None:
            return VehicleCommands()
        state.say(Severity.WARNING, "abort too late: watching the landing again")
        self.resume(s, state.aim.on_ground_enu_m)
        return self.final_commands(s)

    def resume(self, s: Situation, enu_m: Vector) -> None:
        """Resume watching the autopilot's landing at a point, which was begun before a restart or silence."""
        state = self._state
        state.aim.set_target(enu_m)
        state.aim.measure(s.position_enu_m, s.selected)
        state.tally.chosen_enu_m = state.aim.enu_m
        state.selection.select(state.aim.enu_m)
        state.route.start_search(known(s.position_enu_m), s.height_above_home_m, -np.inf)
        state.ownership.adopt_landing(s)
        state.outage.reset()
        state.go(Phase.FINAL, s)
        self._resumed_until_ns = s.now_ns + RESUMED_NS

    def commands(self, s: Situation) -> VehicleCommands:
        """Sink over the selected point, streaming the landing target, until LAND can take over."""
        state, p = self._state, self._state.parameters
        without_gps = state.gps_loss.is_on
        interrupted = self._stop_for_object(s) if without_gps else self._interruption(s)
        if interrupted is not None:
            return interrupted
        if state.path is not None:
            return self._on_path(state.path, s)
        left_m, away_m, target = state.aim.height_left_m, state.aim.away_m, state.aim.on_ground_enu_m
        stands = self._stands(s)
        steady = stands and s.now_ns - state.since_ns > TARGET_NS
        final_m = self._final_m
        low = left_m <= final_m or not state.gps_loss.still_guides(s.now_ns)
        if low and steady and away_m < LAND_WITHIN_M:
            state.say(Severity.INFO, "final: LAND")
            state.go(Phase.FINAL, s)
            return VehicleCommands(mode="land", target_enu_m=target)
        floor = final_m - BELOW_FINAL_M - left_m
        sink = level(min(0.0, floor), p.descent_speed_ms) if stands and away_m < SINK_WITHIN_M else 0.0
        offset = target[:2] - known(s.position_enu_m)[:2]
        horizontal = towards(offset, p.approach_speed_ms, known(s.velocity_enu_ms))
        heading = touchdown_heading_rad(s.selected, s.heading_rad, state.into_wind.heading_rad)
        return VehicleCommands(
            velocity_enu_ms=np.array([*horizontal, sink]), yaw_rad=heading, target_enu_m=target
        )

    @property
    def _final_m(self) -> float:
        """Height over the point for the change to LAND; without GPS as low as it can still slow down."""
        state, p = self._state, self._state.parameters
        lowest_m = state.committed_m + BRAKING_S * p.descent_speed_ms
        return min(p.final_height_m, lowest_m) if state.gps_loss.is_on else p.final_height_m

    def _interruption(self, s: Situation) -> VehicleCommands | None:
        """Return the commands of a wait or an abort; None where the descent goes on."""
        state = self._state
        waiting = self._wait.commands(s)
        if waiting is not None:
            return waiting
        reason = state.why_not(s) or ("point not reached" if s.now_ns > state.late_ns else None)
        return state.break_off(reason, s) if reason else state.give_way(s)

    def _stop_for_object(self, s: Situation) -> VehicleCommands | None:
        """Hover and call the pilot where something came onto the point after GPS was lost; else None."""
        state = self._state
        self._wait.reset()
        if s.intrusion is None or state.is_low:
            return None
        state.say(Severity.CRITICAL, "GPS lost, object on the point: take over")
        return state.break_off(f"object of {s.intrusion.height_m:.1f} m came", s, hold=True)

    def _stands(self, s: Situation) -> bool:
        """Return whether the gear stands at this heading; without GPS that of the descent's begin counts."""
        return self._state.gps_loss.is_on or stands_at(s.selected, s.heading_rad)

    def _on_path(self, path: ApproachPath, s: Situation) -> VehicleCommands:
        """Fly down an approach path, and hand over to LAND from the hover at its end."""
        state, position, velocity = self._state, known(s.position_enu_m), known(s.velocity_enu_ms)
        away_m, target = state.aim.away_m, state.aim.on_ground_enu_m
        if not s.blocked or s.now_ns - state.since_ns < BLOCKED_NS or state.gps_loss.is_on:
            self._free_ns = s.now_ns
        if s.now_ns - self._free_ns >= BLOCKED_NS:
            return state.break_off("way in blocked" + state.wire_suffix(s), s)
        if away_m > TARGET_FROM_M or self._near_since_ns is None or self._near_since_ns < state.since_ns:
            self._near_since_ns = s.now_ns
        stands = self._stands(s)
        down = state.aim.height_left_m <= path.hover_m + HOVERS_WITHIN_M or state.gps_loss.is_on
        if down and away_m < LAND_WITHIN_M and stands and s.now_ns - self._near_since_ns > TARGET_NS:
            state.say(Severity.INFO, "final: LAND")
            state.go(Phase.FINAL, s)
            return VehicleCommands(mode="land", target_enu_m=target)
        yaw_rad: float | None = path.inbound_rad
        if away_m < TURN_FROM_M:
            yaw_rad = touchdown_heading_rad(s.selected, s.heading_rad, state.into_wind.heading_rad)
        return VehicleCommands(
            velocity_enu_ms=path.velocity_enu_ms(position, velocity, target, state.parameters),
            yaw_rad=yaw_rad,
            target_enu_m=target if away_m <= TARGET_FROM_M else None,
        )

    def final_commands(self, s: Situation) -> VehicleCommands:
        """Watch the autopilot land; break off if the point turns unsafe while it can be seen."""
        state = self._state
        late = s.now_ns > state.late_ns
        stopped = self._stop_for_object(s) if state.gps_loss.is_on else None
        if stopped is not None:
            return stopped
        if not state.last_state_holds:
            waiting = self._wait.commands(s)
            if waiting is not None:
                return waiting
            unknown = not s.lidar_ok or state.aim.judgement(s.selected) is PointState.UNKNOWN
            unseen = unknown and s.now_ns < self._resumed_until_ns
            reason = None if unseen else state.why_not(s)
            turned = reason is None and not unseen and not stands_at(s.selected, s.heading_rad)
            reason = reason or ("heading unsafe" if turned else "does not land" if late else None)
            if reason:
                return state.break_off(reason, s)
            given_way = None if unseen else state.give_way(s)
            if given_way is not None:
                return given_way
        elif late:
            state.call("not landing", s)
        target = state.aim.on_ground_enu_m
        if s.guided and s.now_ns - state.since_ns > REQUEST_AGAIN_NS:  # stop the vehicle's last setpoint too
            return VehicleCommands(mode="land", velocity_enu_ms=STOPPED, target_enu_m=target)
        return VehicleCommands(target_enu_m=target)
