"""Snapshots of what is known of vehicle, sensors and map, as the landing executive sees it."""

from __future__ import annotations

from dataclasses import replace

from companion.flight.command_execution import CommandExecution
from companion.flight.commander_watch import CommanderWatch
from companion.flight.doctor.autopilot_fitness import Fitness
from companion.flight.geometry.axes import heading_rad
from companion.flight.landing.situation import MissingInput, Situation
from companion.flight.link.link import Link
from companion.flight.sensing import Sensing
from companion.flight.services.fence_reader import FenceReader
from companion.flight.terrain_mapping import TerrainMapping
from companion.runtime.clock import now_ns
from params import Parameters
from slz import Intrusion, PointState, SelectedPoint

# A heartbeat comes each second; without two of them nobody knows which mode the pilot has chosen.
HEARD_NS = 2_500_000_000
SWITCHED_NS = 2_500_000_000  # a pilot's switch explains a mode that shows so long after it


class SituationSource:
    """Source of situations."""

    def __init__(
        self,
        parameters: Parameters,
        link: Link,
        sensing: Sensing,
        mapping: TerrainMapping,
        execution: CommandExecution,
        fitness: Fitness,
        commanders: CommanderWatch,
        fence: FenceReader,
    ) -> None:
        self._p, self._link = parameters, link
        self._sensing, self._mapping, self._execution = sensing, mapping, execution
        self._fitness, self._commanders, self._fence = fitness, commanders, fence

    def situation(self) -> Situation:
        """Return what is known now."""
        now = now_ns()
        vehicle, health = self._link.vehicle, self._link.vehicle.health
        history, latest, watch = self._sensing.history, self._mapping.latest, self._mapping.watch
        pose, report, intrusion = history.latest(now), latest.fresh(now), watch.intrusion(now)
        landed, odometry, execution = vehicle.landed, self._sensing.odometry, self._execution
        own_landing, values = vehicle.own_landing, self._fitness.values
        return Situation(
            now_ns=now,
            connected=self._link.connected,
            armed=vehicle.armed,
            guided=vehicle.guided,
            landing=vehicle.landing,
            mode=vehicle.mode,
            on_ground=None if landed == "unknown" else landed == "on_ground",
            position_enu_m=None if pose is None else pose.position_enu_m,
            velocity_enu_ms=None if pose is None else pose.velocity_enu_ms,
            height_above_home_m=vehicle.relative_alt_m or 0.0,
            lidar_ok=self.scans_are_fresh(now) and latest.valid(now) is not None,
            report=report,
            selected=_intruded(None if report is None else report.selected, intrusion),
            battery_pct=vehicle.battery_pct,
            blocked=execution.blocked,
            blocked_above=execution.blocked_above,
            heard=self._mode_is_known(now),
            epoch=history.epoch if pose is None else pose.epoch,
            no_map_reason=self._no_map_reason(now),
            failsafe=vehicle.failsafe,
            breached=health.breached,
            estimate_lost=health.estimate_lost,
            gps_lost=health.fix_lost if self._p.odometry == "autopilot" else health.gps_lost,
            gps_glitching=health.glitching,
            tracked=None if odometry is None else odometry.is_tracking(now),
            gps_drift_m=0.0 if odometry is None else odometry.gps_drift_m,
            place_by="" if odometry is None else odometry.name,
            cause=health.cause(now),
            target_lost_ns=health.target_lost_ns,
            sticks_us=health.sticks_us,
            switched=_is_recent(health.switched_ns, now, SWITCHED_NS),
            fit=self._fitness.fit,
            heading_rad=None if pose is None else heading_rad(pose.rotation_enu_from_frd),
            below=self._mapping.worker.below,
            wind=self._sensing.wind.at(now),
            intrusion=intrusion,
            moving=watch.moving(now),
            no_command_reason=self._link.no_command_reason,
            fence=self._fence.geofence(vehicle, history.frame),
            asked_enu_ms=execution.sent_enu_ms,
            commander=self._commanders.commander(),
            judged_ns=latest.arrived_ns,
            lands_itself=own_landing is not None,
            follows_target=own_landing is not None
            and own_landing.follows_target
            and values.get(own_landing.switch, 1.0) > 0,
        )

    def scans_are_fresh(self, now: int) -> bool:
        """Return whether something is seen and the LiDAR sends: a radar sees beside it, not in its place."""
        stamps = [self._mapping.feed.last_scan_ns]
        if self._sensing.radar is not None:
            stamps.append(self._sensing.lidar.last_arrival_ns)
        limit = self._p.lidar_timeout_s * 1e9
        return all(at_ns is not None and now - at_ns < limit for at_ns in stamps)

    # ---- parts ----------------------------------------------------------------------------------

    def _no_map_reason(self, now: int) -> MissingInput:
        """Return why scans or map are missing: the link, the LiDAR or the computer."""
        if not self._mode_is_known(now) or self._sensing.history.latest(now) is None:
            return MissingInput.LINK_LOST  # scans wait for poses
        if not _is_recent(self._sensing.lidar.last_arrival_ns, now, round(self._p.lidar_timeout_s * 1e9)):
            return MissingInput.LIDAR_LOST
        if not self.scans_are_fresh(now):
            return MissingInput.SCANS_LATE
        if self._mapping.latest.is_withdrawn:
            return MissingInput.MAP_INVALID
        return MissingInput.MAP_BEGINS if self._mapping.latest.begins(now) else MissingInput.MAP_LATE

    def _mode_is_known(self, now: int) -> bool:
        return _is_recent(self._link.vehicle.last_heartbeat_ns, now, HEARD_NS)


def _intruded(selected: SelectedPoint | None, intrusion: Intrusion | None) -> SelectedPoint | None:
    """Return the selected point, unsafe with something on it that its map does not show."""
    if selected is None or intrusion is None:
        return selected
    return replace(selected, state=PointState.UNSAFE)


def _is_recent(at_ns: int | None, now: int, limit_ns: int) -> bool:
    return at_ns is not None and now - at_ns < limit_ns
