"""Scans on their way from georeferencing to the map: which are mapped, and when a new map begins."""

from __future__ import annotations

import logging

from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.geometry.pose import Pose
from companion.flight.landing.executive import Executive
from companion.flight.landing.situation import Severity
from companion.flight.link.link import Link
from companion.flight.mapping.pipeline_worker import PipelineWorker
from companion.flight.mapping.point_watch import PointWatch
from companion.flight.mapping.recent_obstacles import RecentObstacles
from companion.runtime.clock import now_ns
from companion.runtime.event import Event
from slz import LocalFrame, MovingObject, Scan, only_objects, without_specks

log = logging.getLogger(__name__)


class ScanFeed:
    """Hands scans to the map.

    Attributes
    ----------
    last_scan_ns
        Time at which the newest scan was placed, None before the first.
    on_pose
        Event (pose, map frame) of the vehicle at each scan of the LiDAR.
    on_moving
        Event of the moving objects after a scan that was watched.
    on_new_map
        Event of a new map: what was found on the one before no longer counts.
    """

    def __init__(
        self,
        link: Link,
        history: PoseHistory,
        assembler: ScanAssembler,
        worker: PipelineWorker,
        executive: Executive,
        obstacles: RecentObstacles,
        watch: PointWatch,
    ) -> None:
        self._link, self._history, self._assembler = link, history, assembler
        self._worker, self._executive, self._obstacles = worker, executive, obstacles
        self._watch = watch
        self.last_scan_ns: int | None = None
        self.on_pose: Event[[Pose, LocalFrame]] = Event()
        self.on_moving: Event[[tuple[MovingObject, ...]]] = Event()
        self.on_new_map: Event[[]] = Event()
        self._flown = self._warned = False
        self._scan_epoch = self._map_epoch = history.epoch

    def add_lidar_scan(self, scan: Scan) -> None:
        """Take a scan of the LiDAR; specks are neither obstacles, intruders nor ground."""
        if self._history.epoch != self._scan_epoch:
            self._scan_epoch = self._history.epoch
            self.follow_jumps()
            return  # it may still be of the frame before
        at_ns = self.last_scan_ns = now_ns()
        if (pose := self._history.latest(at_ns)) is not None:
            self.on_pose.emit(pose, scan.frame)
        self._obstacles.add(scan)
        scan = without_specks(scan)
        if self._executive.mapping:  # rotor dust, lower down, is no intruder
            self._watch.add(only_objects(scan), at_ns)
            self.on_moving.emit(self._watch.moving(at_ns))
        self._add_scan(scan)

    def add_radar_scan(self, scan: Scan) -> None:
        """Take a scan of the radar; its points come late and in blocks, so they are no obstacles at hand."""
        if self._history.epoch != self._scan_epoch:
            return  # the next scan of the LiDAR, or the radar's own after it, begins the new map
        self.last_scan_ns = now_ns()
        self._add_scan(scan)

    def follow_jumps(self) -> None:
        """Begin a new map if the position estimate jumped."""
        if self._history.epoch == self._map_epoch:
            return
        log.warning("the position estimate jumped: mapping anew")
        self._reset_map()

    def warn_of_attitudes(self) -> None:
        """Warn the pilot once that attitudes come too seldom for the turns, so that scans are lost."""
        if self._history.steps.coarse and not self._warned:
            self._warned = True
            self._link.statustext("SLZ: attitudes too far apart: scans dropped", Severity.WARNING.value)

    def begin_frame(self) -> None:
        """Begin a new map in the frame that has just begun."""
        self._scan_epoch = self._history.epoch  # what waits to be placed will be in the new frame
        self._reset_map()

    def _reset_map(self) -> None:
        self._map_epoch = self._history.epoch
        self._worker.reset()
        self._watch.forget()
        self.on_new_map.emit()

    def _add_scan(self, scan: Scan) -> None:
        """Map a scan, if this is the time for it."""
        if not self._link.ready:
            return  # a window would wait for the warm-up, and be late
        if not self._executive.mapping or self._stands_after_flight():
            self._worker.flush()
        elif len(scan):
            self._worker.add_scan(scan, self._assembler.scans)

    def _stands_after_flight(self) -> bool:
        """Return whether the vehicle has landed: from its skids it sees the ground at grazing angles only."""
        landed = self._link.vehicle.landed
        self._flown = self._flown or landed == "in_air"
        return self._flown and landed == "on_ground"
