"""Manager of a flight's recordings: one from the start, others begun and ended in flight."""

from __future__ import annotations

import asyncio
import itertools
import logging
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from companion.flight.fusion.assembler import ScanAssembler
from companion.flight.fusion.external_odometry.odometry_input import OdometryInput
from companion.flight.geometry.pose import Pose
from companion.flight.landing.situation import Reply
from companion.flight.link.link import Link
from companion.flight.mapping.pipeline_worker import PipelineWorker
from companion.flight.recorder.recorder import Recorder
from companion.flight.sensors.lidar_url import HasBatches
from companion.flight.services.settings import Settings
from companion.runtime.clock import WallOffset
from companion.runtime.errors import UsageError
from companion.runtime.event import Unsubscribe
from companion.runtime.state_directory import StateDir
from slz import LocalFrame, MovingObject, Report

log = logging.getLogger(__name__)


class Recordings:
    """Makes one recording at a time from link, sensor, pipeline and settings.

    Parameters
    ----------
    stream
        Packet stream of the first sensor; a second one is not recorded.
    state
        State directory for recordings begun in flight; None allows none.
    assembler
        Counts the scans, by which windows number theirs.
    odometry
        An external odometry, if any.

    Attributes
    ----------
    recorder
        Recorder of the current recording, None without one.
    """

    def __init__(
        self,
        link: Link,
        stream: HasBatches,
        worker: PipelineWorker,
        settings: Settings,
        wall_offset_ns: WallOffset,
        state: StateDir | None,
        assembler: ScanAssembler | None = None,
        odometry: OdometryInput | None = None,
    ) -> None:
        self._link, self._stream, self._worker, self._settings = link, stream, worker, settings
        self._wall_offset_ns, self._assembler = wall_offset_ns, assembler
        self._odometry = odometry
        self._folder = None if state is None else state.folder / "recordings"
        self._unsubscribe: Sequence[Unsubscribe] = ()
        self.recorder: Recorder | None = None

    # ---- what is recorded, while something is ----------------------------------------------------

    def use_report(self, report: Report) -> None:
        """Record a report."""
        if self.recorder is not None:
            self.recorder.use_report(report)

    def pose(self, pose: Pose, frame: LocalFrame) -> None:
        """Record the vehicle's pose."""
        if self.recorder is not None:
            self.recorder.pose(pose, frame)

    def moving(self, objects: tuple[MovingObject, ...]) -> None:
        """Record what moves around the vehicle."""
        if self.recorder is not None:
            self.recorder.moving(objects)

    def frame_begun(self, frame: LocalFrame) -> None:
        """Record the beginning of a map frame."""
        if self.recorder is not None:
            self.recorder.frame_begun(frame)

    # ---- begin and end ---------------------------------------------------------------------------

    def start_recording(self, path: Path) -> None:
        """Begin recording into a file.

        Raises
        ------
        UsageError
            The file cannot be created.
        """
        stream, settings = self._stream, self._settings
        link = self._link.identity, not self._link.inbox.gate.is_open
        scans = 0 if self._assembler is None else self._assembler.scans
        begun = self._wall_offset_ns(), stream.metadata, scans
        topic = "" if self._odometry is None else str(self._odometry.topic)
        recorder = Recorder(path, stream.kind, settings.running, *begun, *link, topic)
        self._unsubscribe = (
            self._link.on_frame.subscribe(recorder.frame_in),
            self._link.on_sent.subscribe(recorder.frame_out),
            self._link.on_time_asked.subscribe(recorder.time_asked),
            stream.batches.subscribe(recorder.packets),
            self._worker.on_window.subscribe(recorder.window),
            settings.on_change.subscribe(recorder.changed),
        )
        if self._odometry is not None:
            messages = self._odometry.stream.batches.subscribe(recorder.odometry_messages)
            self._unsubscribe = (*self._unsubscribe, messages)
        self.recorder = recorder

    def start_flight_recording(self, path: Path) -> None:
        """Record into a file, or a numbered one if it exists; a failure is only logged."""
        try:
            self.start_recording(fresh(path))
        except (OSError, UsageError) as error:
            log.warning("this flight is not recorded: %s", error)

    async def set_recording(self, on: bool) -> Reply:
        """Begin a recording in the state directory, or end the current one."""
        recorder = self.recorder
        if on == (recorder is not None):
            return Reply(False, "recording already" if on else "nothing is recorded")
        if recorder is not None:
            self.recorder = None
            for unsubscribe in self._unsubscribe:
                unsubscribe()
            await asyncio.get_running_loop().run_in_executor(None, recorder.close)
            return Reply(True, "recording ended")
        if self._folder is None:
            return Reply(False, "there is no state directory to record in")
        path = self._folder / time.strftime("slz-%Y%m%d-%H%M%S.mcap", time.gmtime())
        try:
            self._folder.mkdir(exist_ok=True)
            self.start_recording(path)
        except (OSError, UsageError) as error:
            return Reply(False, f"cannot record: {error}")
        return Reply(True, f"recording {path.name}")

    def close(self) -> None:
        """Close the recording; its statistics stay available."""
        if self.recorder is not None:
            self.recorder.close()

    def statistics(self) -> dict[str, Any] | None:
        """Return the statistics of the recording, None without one."""
        return None if self.recorder is None else self.recorder.statistics()


def fresh(path: Path) -> Path:
    """Return this path if nothing exists there, else the same with the next free number."""
    names = (path.with_stem(f"{path.stem}-{number}") for number in itertools.count(2))
    return next(name for name in itertools.chain([path], names) if not name.exists())
