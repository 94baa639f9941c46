"""Snapshots of what is known of vehicle, sensors and map, as the landing executive sees it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from companion.flight.commander_watch import CommanderWatch
from companion.flight.doctor.autopilot_fitness import Fitness
from companion.flight.fusion.odometry.place_source import PlaceSource
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.fusion.wind_estimate import WindEstimate
from companion.flight.geometry.axes import heading_rad
from companion.flight.landing.situation import MissingInput, Situation
from companion.flight.link.link import Link
from companion.flight.mapping.pipeline_worker import PipelineWorker
from companion.flight.mapping.point_watch import PointWatch
from companion.flight.sensors.lidar_url import Lidar
from companion.flight.services.fence_reader import FenceReader
from companion.runtime.clock import now_ns
from params import Parameters
from slz import Intrusion, PointState, Report, SelectedPoint

# A heartbeat comes each second; without two of them nobody knows which mode the pilot has chosen.
HEARD_NS = 2_500_000_000
SWITCHED_NS = 2_500_000_000  # a pilot's switch explains a mode that shows so long after it


class SituationSource:
    """Source of situations.

    Parameters
    ----------
    radar
        A radar beside the LiDAR, if any.
    odometry
        None while it is off.

    Attributes
    ----------
    newest
        The newest report of the present map, None before the first.
    blocked, blocked_above
        Something is in the way that the last velocity led, ahead or above.
    asked_enu_ms
        Velocity (3,) of the last setpoint, None without one.
    """

    def __init__(
        self,
        parameters: Parameters,
        link: Link,
        history: PoseHistory,
        worker: PipelineWorker,
        lidar: Lidar,
        radar: Lidar | None,
        fitness: Fitness,
        wind: WindEstimate,
        watch: PointWatch,
        commanders: CommanderWatch,
        odometry: PlaceSource | None,
        fence: FenceReader,
    ) -> None:
        self._odometry, self._fence = odometry, fence
        self._p = parameters
        self._link, self._history, self._worker = link, history, worker
        self._lidar, self._radar, self._fitness = lidar, radar, fitness
        self._wind, self._watch, self._commanders = wind, watch, commanders
        self.newest: Report | None = None
        self.blocked = self.blocked_above = False
        self.asked_enu_ms: NDArray[np.float64] | None = None
        self._last_scan_ns: int | None = None
        self._last_report_ns: int | None = None
        self._map_begun_ns: int | None = None

    # ---- what comes in --------------------------------------------------------------------------

    def on_scan(self, at_ns: int) -> None:
        """Note that a scan was placed on the map."""
        self._last_scan_ns = at_ns

    def use_report(self, report: Report) -> None:
        """Use a new report."""
        self.newest, self._last_report_ns = report, now_ns()
        self._watch.use_report(report)

    def on_new_map(self) -> None:
        """Forget the report: it was of the map before."""
        self.newest, self._last_report_ns, self._map_begun_ns = None, None, now_ns()

    # ---- what is known --------------------------------------------------------------------------

    def situation(self) -> Situation:
        """Return what is known now."""
        now = now_ns()
        vehicle, health = self._link.vehicle, self._link.vehicle.health
        pose = self._history.latest(now)
        report = self.newest if self.report_is_fresh(now) else None
        landed = vehicle.landed
        intrusion = self._watch.intrusion(now)
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
            lidar_ok=self.scans_are_fresh(now) and self.report_is_fresh(now) and not self._worker.invalid,
            report=report,
            selected=_intruded(None if report is None else report.selected, intrusion),
            battery_pct=vehicle.battery_pct,
            blocked=self.blocked,
            blocked_above=self.blocked_above,
            heard=self._mode_is_known(now),
            epoch=self._history.epoch if pose is None else pose.epoch,
            no_map_reason=self._no_map_reason(now),
            failsafe=vehicle.failsafe,
            breached=health.breached,
            estimate_lost=health.estimate_lost,
            gps_lost=health.fix_lost if self._p.odometry == "autopilot" else health.gps_lost,
            gps_glitching=health.glitching,
            tracked=None if self._odometry is None else self._odometry.is_tracking(now),
            gps_drift_m=0.0 if self._odometry is None else self._odometry.gps_drift_m,
            place_by="" if self._odometry is None else self._odometry.name,
            cause=health.cause(now),
            target_lost_ns=health.target_lost_ns,
            sticks_us=health.sticks_us,
            switched=_is_recent(health.switched_ns, now, SWITCHED_NS),
            fit=self._fitness.fit,
            heading_rad=None if pose is None else heading_rad(pose.rotation_enu_from_frd),
            below=self._worker.below,
            wind=self._wind.at(now),
            intrusion=intrusion,
            moving=self._watch.moving(now),
            no_command_reason=self._link.no_command_reason,
            fence=self._fence.geofence(vehicle, self._history.frame),
            asked_enu_ms=self.asked_enu_ms,
            commander=self._commanders.commander(),
            judged_ns=self._last_report_ns,
        )

    def fresh_report(self) -> Report | None:
        """Return the newest report if it is fresh and valid."""
        return self.newest if self.report_is_fresh(now_ns()) and not self._worker.invalid else None

    def report_now(self) -> Report | None:
        """Return the newest report if it is fresh."""
        return self.newest if self.report_is_fresh(now_ns()) else None

    def report_is_fresh(self, now: int) -> bool:
        """Tell whether the newest report is of the last windows: they last up to 2 s over few returns."""
        return _is_recent(self._last_report_ns, now, self._report_limit_ns)

    def scans_are_fresh(self, now: int) -> bool:
        """Tell whether something is seen, and the LiDAR sends: a radar sees for it, but not in its place."""
        stamps = [self._last_scan_ns]
        if self._radar is not None:
            stamps.append(self._lidar.last_arrival_ns)
        limit = self._p.lidar_timeout_s * 1e9
        return all(at_ns is not None and now - at_ns < limit for at_ns in stamps)

    # ---- parts ----------------------------------------------------------------------------------

    def _no_map_reason(self, now: int) -> MissingInput:
        """Return why scans or map are missing: the link, the LiDAR or the computer."""
        if not self._mode_is_known(now) or self._history.latest(now) is None:
            return MissingInput.LINK_LOST  # scans wait for poses
        if not _is_recent(self._lidar.last_arrival_ns, now, round(self._p.lidar_timeout_s * 1e9)):
            return MissingInput.LIDAR_LOST
        if not self.scans_are_fresh(now):
            return MissingInput.SCANS_LATE
        if self._worker.invalid:
            return MissingInput.MAP_INVALID
        begins = _is_recent(self._map_begun_ns, now, self._report_limit_ns)
        return MissingInput.MAP_BEGINS if begins else MissingInput.MAP_LATE

    @property
    def _report_limit_ns(self) -> int:
        return round((self._worker.window_s + self._p.window_s + 1.0) * 1e9)

    def _mode_is_known(self, now: int) -> bool:
        return _is_recent(self._link.vehicle.last_heartbeat_ns, now, HEARD_NS)


def _intruded(selected: SelectedPoint | None, intrusion: Intrusion | None) -> SelectedPoint | None:
    """Return the selected point, unsafe with something on it that its map does not show."""
    if selected is None or intrusion is None:
        return selected
    return replace(selected, state=PointState.UNSAFE)


def _is_recent(at_ns: int | None, now: int, limit_ns: int) -> bool:
    return at_ns is not None and now - at_ns < limit_ns
