"""Replay of another program's recording through the fusion, windows and pipeline of a flight."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from companion.desk.replay.own_replay import ReplayOutcome
from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.odometry.place_source import open_odometry
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.sensors.diagnosis.lidar_diagnosis import LidarDiagnosis
from companion.flight.sensors.imu_samples import ImuSamples
from companion.flight.sensors.returns import Returns
from companion.runtime.event import Event
from params import Parameters
from slz import (
    LocalFrame,
    Pipeline,
    Report,
    Scan,
    SpeckDetector,
    TerrainMaps,
    Window,
    Windower,
    without_specks,
)
from slz.paper.paper_report import chosen_map

log = logging.getLogger(__name__)

Act = Callable[[], None]


class Feed(Protocol):
    """Source of a recorded flight's measurements."""

    @property
    def cut(self) -> str:
        """Reason for the missing end of a file, empty where all are complete; known at the end."""

    @property
    def bad(self) -> int:
        """Number of messages that could not be read."""

    def steps(self, rerun: Rerun) -> Iterator[tuple[int, Act]]:
        """Yield every measurement in order: its time (ns), and the call that hands it over."""

    def summary(self) -> dict[str, Any]:
        """Return the chosen sources and the counts, for JSON."""


class Rerun:
    """Fusion and mapping of a feed's poses and returns.

    Parameters
    ----------
    frame
        Of the map; if None, the first position becomes its origin. Far from it a new frame begins.

    Attributes
    ----------
    history
        The vehicle's poses; filled by the feed.
    standing
        The vehicle is on the ground, and sees it at grazing angles only: nothing is mapped.
    standing_scans
        Scans made meanwhile.
    on_imu
        Event of the inertial samples of the LiDAR, emitted by a feed that holds its packets.
    returns, span_ns
        Number of returns, and their oldest and newest stamp.
    diagnosis
        Diagnosis of the LiDAR's stream and clock; None unless the feed holds its packets.
    poses_ns
        Oldest and newest time that has poses; None without any.
    """

    def __init__(self, parameters: Parameters, frame: LocalFrame | None = None) -> None:
        self.parameters = parameters
        self.history = PoseHistory(parameters, frame)
        odometry = open_odometry(parameters, self.history)
        self.assembler = ScanAssembler(parameters, self.history, self._on_scan, SpeckDetector(), odometry)
        self.outcome = ReplayOutcome()
        self.report: Report | None = None
        self.standing = False
        self.standing_scans = 0
        self.on_imu: Event[[ImuSamples]] = Event()
        if odometry is not None:
            self.on_imu.subscribe(odometry.gyro.add_samples)
        self.returns = 0
        self.span_ns: tuple[int, int] | None = None
        self.poses_ns: tuple[int, int] | None = None
        self.diagnosis: LidarDiagnosis | None = None
        self._windower = Windower(parameters.window_s)
        self._pipeline = Pipeline(parameters)
        self._epoch = 0
        self._mapping = True
        self._fresh: Report | None = None

    def hand_over(self, act: Act, mapping: bool = True) -> Report | None:
        """Hand over a measurement of a feed; return the report of a window that it completed, else None."""
        self._mapping, self._fresh = mapping, None
        act()
        return self._fresh

    def finish(self) -> Report | None:
        """Place what waits for poses or for the rest of its scan, and map the incomplete last window."""
        self._fresh = None
        self.assembler.finish()
        if (window := self._windower.flush()) is not None:
            self._process(window)
        return self._fresh

    def maps(self) -> TerrainMaps | None:
        """Return the current maps."""
        return self._pipeline.maps(which=chosen_map(self.report))

    @property
    def vehicle(self) -> VehicleState:
        """An empty state: another program's recording holds poses only."""
        return VehicleState()

    @property
    def pipeline(self) -> Pipeline:
        """The current pipeline."""
        return self._pipeline

    def add_returns(self, returns: Returns) -> None:
        """Add a batch of returns."""
        if len(returns):
            self._note(returns.stamp_ns)
            self.assembler.add(returns)

    def add_placed(self, scan: Scan) -> None:
        """Add returns that another program georeferenced, in the frame of `history`."""
        self._note(scan.stamp_ns)
        self._on_scan(scan)

    def _note(self, stamp_ns: NDArray[np.int64]) -> None:
        """Update the number of returns and the spans of returns and poses."""
        oldest, newest = int(stamp_ns.min()), int(stamp_ns.max())
        first, last = self.span_ns or (oldest, newest)
        self.span_ns = min(first, oldest), max(last, newest)
        self.returns += len(stamp_ns)
        posed_ns = self.history.bracketed_until_ns
        if posed_ns is not None:
            self.poses_ns = (posed_ns if self.poses_ns is None else self.poses_ns[0]), posed_ns

    # ---- mapping --------------------------------------------------------------------------------

    def _on_scan(self, scan: Scan) -> None:
        why = "the position estimate jumped"
        if self.history.is_far:
            self.history.begin_frame()
            why = "the vehicle is far from the map's origin"
        if self.history.epoch != self._epoch:
            self._epoch = self.history.epoch
            log.warning("%s: mapping anew", why)
            self._pipeline.begin_new_map()
            self._windower = Windower(self._windower.window_s)
            self.report = None
            return
        self.standing_scans += self.standing
        if self._mapping and not self.standing:
            for window in self._windower.add(without_specks(scan)):
                self._process(window)

    def _process(self, window: Window) -> None:
        self.outcome.windows += 1
        try:
            report = self._pipeline.process(window)
        except Exception:
            self.outcome.failed += 1
            log.exception("the pipeline failed on a window")
            return
        self.report = self._fresh = report
        self._windower.window_s = report.choice.window_s
        self.outcome.fly(window.sensor_enu_m, window.frame)
