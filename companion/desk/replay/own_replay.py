"""Bit-exact replay of a flight recorded by slz, through the same code as in flight."""

from __future__ import annotations

import json
import logging
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.replay.recorded_sensors import RecordedSensors
from companion.desk.replay.recording_reader import Header, Raw
from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.pose_history import PoseHistory
from companion.flight.link.vehicle_state import VehicleState
from companion.flight.mapping.window_event import WindowEvent
from companion.flight.recorder import journal
from companion.flight.sensors.diagnosis.lidar_diagnosis import LidarDiagnosis
from companion.flight.sensors.returns import Returns
from params import Parameters, rows
from slz import LocalFrame, Pipeline, Report, Scan, SpeckDetector, TerrainMaps, without_specks
from slz.paper.paper_report import chosen_map
from slz.window import join

log = logging.getLogger(__name__)

MOST_SCANS = 4000  # kept for later windows: three minutes


@dataclass(slots=True)
class ReplayOutcome:
    """Counts and path of a replay.

    windows: processed. same, other: reports equal to the flight's to the last bit, and different ones.
    first_other_ns: stamp of the first different one. without_scans: windows with missing scans. failed:
    windows at which the pipeline raised. lost: messages that the recorder dropped. bad: unreadable
    messages. path_enu_m: positions of the sensor, in the frame of the newest window.
    """

    windows: int = 0
    same: int = 0
    other: int = 0
    first_other_ns: int | None = None
    without_scans: int = 0
    failed: int = 0
    lost: int = 0
    bad: int = 0
    path_enu_m: list[Any] = field(default_factory=list)
    _frame: LocalFrame | None = None

    def fly(self, sensor_enu_m: NDArray[np.float64], frame: LocalFrame) -> None:
        """Append a position to the path; a new frame converts the earlier path."""
        if self._frame is not None and self._frame != frame and self.path_enu_m:
            self.path_enu_m = list(frame.enu_m(*self._frame.lla(self.path_enu_m).T))
        self._frame = frame
        self.path_enu_m.append(sensor_enu_m)


class Replay:
    """Replay of a flight, message by message.

    Windows are the ones that the flight's pipeline processed, since the scans that the busy program skipped
    are part of the flight.

    Parameters
    ----------
    header
        The recording's.
    parameters
        Parameters of the run; those of the flight reproduce its zones.
    """

    def __init__(self, header: Header, parameters: Parameters) -> None:
        self.parameters = parameters
        self._sensors = RecordedSensors(header, parameters, self._on_returns)
        history, odometry = self._sensors.history, self._sensors.odometry
        self._assembler = ScanAssembler(parameters, history, self._on_scan, SpeckDetector(), odometry)
        if self._sensors.diagnosis is not None:
            self._sensors.diagnosis.placed = self._assembler
        self._pipeline = Pipeline(parameters)
        flown = header.parameters()
        self._as_flown = {
            row.name for row in rows() if getattr(flown, row.name) == getattr(parameters, row.name)
        }
        self._scans: deque[tuple[int, Scan]] = deque(maxlen=MOST_SCANS)
        self._before = header.scans
        self._document = b""
        self.report: Report | None = None
        self.outcome = ReplayOutcome()

    def process_message(self, message: Raw, mapping: bool = True) -> Report | None:
        """Process the next message; return the report if it was a window that is mapped, else None."""
        try:
            if message.topic == journal.REPORT:
                self._compare(message.data)
            elif message.topic == journal.GAP:
                self.outcome.lost += int(json.loads(message.data)["lost"])
            elif (event := self._sensors.on_message(message)) is not None:
                return self._window(event, mapping)
        except (ValueError, TypeError, KeyError) as error:
            self.outcome.bad += 1
            log.warning("a message on %s cannot be read: %s", message.topic, error)
        return None

    def maps(self) -> TerrainMaps | None:
        """Return the current maps."""
        return self._pipeline.maps(which=chosen_map(self.report))

    @property
    def history(self) -> PoseHistory:
        """The vehicle's poses."""
        return self._sensors.history

    @property
    def vehicle(self) -> VehicleState:
        """The vehicle's state, from the autopilot's messages up to now."""
        return self._sensors.vehicle

    @property
    def diagnosis(self) -> LidarDiagnosis | None:
        """Diagnosis of the LiDAR's stream and clock; None for a sensor that is not diagnosed."""
        return self._sensors.diagnosis

    @property
    def pipeline(self) -> Pipeline:
        """The current pipeline."""
        return self._pipeline

    # ---- recorded events ------------------------------------------------------------------------

    def _on_returns(self, returns: Returns) -> None:
        self._assembler.add(returns)

    def _on_scan(self, scan: Scan) -> None:
        if len(scan := without_specks(scan)):
            self._scans.append((self._before + self._assembler.scans, scan))

    def _window(self, event: WindowEvent, mapping: bool) -> Report | None:
        if changed := {name: value for name, value in event.changed if name in self._as_flown}:
            self._pipeline.use(self._pipeline.parameters.model_copy(update=changed))
        if event.anew:
            self._pipeline.begin_new_map()
        for point in event.selects:
            self._pipeline.select(None if point is None else np.array(point))
        self._document = b""
        if not mapping:
            return None
        wanted = event.numbers()
        scans = [scan for number, scan in self._scans if wanted and wanted[0] <= number <= wanted[-1]]
        if len(scans) != len(wanted) or not scans:
            self.outcome.without_scans += 1
            return None
        while self._scans and self._scans[0][0] <= wanted[-1]:
            self._scans.popleft()
        self.outcome.windows += 1
        try:
            self.report = self._pipeline.process(join(scans))
        except Exception:
            self.outcome.failed += 1
            log.exception("the pipeline failed on a window")
            return None
        self.outcome.fly(scans[-1].sensor_enu_m, scans[-1].frame)
        self._document = journal.report_document(self.report)
        return self.report

    def _compare(self, document: bytes) -> None:
        if not self._document:  # its window was not replayed
            return
        if document == self._document:
            self.outcome.same += 1
            return
        self.outcome.other += 1
        if self.outcome.first_other_ns is None:
            self.outcome.first_other_ns = int(json.loads(document)["stamp_ns"])
