"""Flight recorder: records the inputs and results of the program's parts."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from companion.flight.geometry.pose import Pose
from companion.flight.link.vehicle_identity import VehicleIdentity
from companion.flight.mapping.window_event import WindowEvent
from companion.flight.recorder import journal, topics
from companion.flight.recorder.recording_writer import MIB, Entry, McapWriter
from companion.runtime import extras
from companion.runtime.clock import now_ns
from params import Parameters
from slz import LocalFrame, MovingObject, Report, Window

CLOUD_BYTES = 12 * topics.MOST_POINTS
SMALL_BYTES = 512
POSE_NS, ZONES_NS = 100_000_000, 500_000_000
FIX_NS = 200_000_000


class Recorder:
    """Recorder of one flight.

    Replay data are lost only when the queue to the disk is full; a gap is then recorded, and the replay
    reports it.

    Parameters
    ----------
    path
        File to create.
    lidar
        Kind of the sensor, as in the LiDAR's URL.
    parameters
        Parameters in force; `record_mb` bounds the file.
    wall_offset_ns
        Offset of the time of day from the companion's clock; constant, so that the file's stamps do not jump.
    lidar_metadata
        Metadata of the sensor that decoding needs beside the packets.
    identity
        Identity of the vehicle, as far as it is known.
    gated
        Whether positions are withheld until the first one with a fix.
    odometry
        Topic of an external odometry, empty without one.

    Raises
    ------
    UsageError
        The file exists or cannot be created.
    """

    def __init__(
        self,
        path: Path,
        lidar: str,
        parameters: Parameters,
        wall_offset_ns: int,
        lidar_metadata: str = "",
        scans: int = 0,
        identity: VehicleIdentity | None = None,
        gated: bool = False,
        odometry: str = "",
    ) -> None:
        self._wall_offset_ns = wall_offset_ns
        self._lost = 0
        self._last_pose_ns = self._last_fix_ns = self._last_moving_ns = self._last_zones_ns = 0
        values = parameters.model_dump(mode="json")
        metadata = {
            "version": str(journal.VERSION),
            "lidar": lidar,
            "lidar_setup": lidar_metadata,
            "parameters": json.dumps(values),
            "clock_offset_ns": str(wall_offset_ns),
            "scans": str(scans),
            "gated": str(int(gated)),
            "odometry": odometry,
        }
        if identity is not None:
            metadata |= {"system": str(identity.known or ""), "remembered": str(identity.remembered or "")}
        self._display = _display()
        channels = None if self._display is None else self._display.channels
        self._name = path.name
        self._writer = McapWriter(path, channels, int(parameters.record_mb * MIB), metadata)
        self._handler = _LogHandler(self._log)
        logging.getLogger("companion").addHandler(self._handler)
        self._put(topics.PARAMETERS, json.dumps(values).encode(), now_ns())

    # ---- replay data ----------------------------------------------------------------------------

    def frame_in(self, message: Any, at_ns: int) -> None:
        """Record an accepted frame."""
        self._raw(journal.MAVLINK_IN, bytes(message.get_msgbuf()), at_ns)

    def frame_out(self, frame: bytes) -> None:
        """Record a sent frame."""
        self._put(journal.MAVLINK_OUT, frame, now_ns())

    def time_asked(self, at_ns: int) -> None:
        """Record a request for the autopilot's time."""
        self._raw(journal.EVENT, json.dumps({"time_asked_ns": at_ns}).encode(), at_ns)

    def packets(self, batch: journal.Batch) -> None:
        """Record a batch of the sensor's packets, before decoding."""
        self._raw(journal.LIDAR, lambda: journal.pack_batch(batch), now_ns(), journal.packed_bytes(batch))

    def odometry_messages(self, batch: journal.Batch) -> None:
        """Record messages of an external odometry, before decoding."""
        self._raw(journal.ODOMETRY, journal.pack_batch(batch), now_ns())

    def window(self, event: WindowEvent, window: Window) -> None:
        """Record the window that the pipeline starts on."""
        at_ns = now_ns()
        self._raw(journal.EVENT, journal.pack_window(event), at_ns)
        wall_ns = self._wall_ns(at_ns)
        self._show(topics.POINTS, lambda display: display.cloud(window, wall_ns), at_ns, CLOUD_BYTES)

    def frame_begun(self, frame: LocalFrame) -> None:
        """Record the beginning of a map frame."""
        at_ns = now_ns()
        self._raw(journal.EVENT, journal.pack_frame(frame), at_ns)

    def use_report(self, report: Report) -> None:
        """Record a report, and draw its zones at most twice a second."""
        at_ns = now_ns()
        wall_ns = self._wall_ns(at_ns)
        self._raw(journal.REPORT, lambda: journal.report_document(report), at_ns)
        if self._last_zones_ns and at_ns - self._last_zones_ns < ZONES_NS:
            return
        self._last_zones_ns = at_ns
        self._show(topics.ZONES, lambda display: display.scene(report, wall_ns), at_ns)
        self._show(topics.GEOJSON, lambda display: display.geojson(report), at_ns)

    # ---- display data ---------------------------------------------------------------------------

    def pose(self, pose: Pose, frame: LocalFrame) -> None:
        """Record the vehicle's pose, at most ten times a second."""
        at_ns = now_ns()
        wall_ns = self._wall_ns(at_ns)
        if at_ns - self._last_pose_ns >= POSE_NS:
            self._last_pose_ns = at_ns
            self._show(topics.TRANSFORM, lambda display: display.transform(pose, wall_ns), at_ns)
        if at_ns - self._last_fix_ns >= FIX_NS:
            self._last_fix_ns = at_ns
            self._show(topics.FIX, lambda display: display.fix(pose, frame, wall_ns), at_ns)

    def moving(self, objects: tuple[MovingObject, ...]) -> None:
        """Record what moves around the vehicle, at most ten times a second."""
        at_ns = now_ns()
        if objects and at_ns - self._last_moving_ns >= POSE_NS:
            self._last_moving_ns, wall_ns = at_ns, self._wall_ns(at_ns)
            self._show(topics.MOVING, lambda display: display.moving(objects, at_ns, wall_ns), at_ns)

    def changed(self, name: str, value: Any) -> None:
        """Record a changed parameter."""
        self._put(topics.PARAMETERS, json.dumps({name: value}).encode(), now_ns())

    # ---- end ------------------------------------------------------------------------------------

    def close(self) -> None:
        """Write queued messages and close the file."""
        logging.getLogger("companion").removeHandler(self._handler)
        self._writer.close()

    def statistics(self) -> dict[str, Any]:
        """Return name and size of the file, messages by topic, and the reason of an early end, if any."""
        writer = self._writer
        return {
            "name": self._name,
            "size_mb": round(writer.size_bytes / MIB, 1),
            "written": dict(writer.written),
            "dropped": dict(writer.dropped),
            "ended": writer.ended,
        }

    # ---- parts ----------------------------------------------------------------------------------

    def _raw(self, topic: str, data: bytes | Callable[[], Any], at_ns: int, size: int = SMALL_BYTES) -> None:
        """Record replay data, and the gap after a loss."""
        if self._lost and self._put(journal.GAP, json.dumps({"lost": self._lost}).encode(), at_ns):
            self._lost = 0
        if self._lost or not self._put(topic, data, at_ns, size):
            self._lost += 1

    def _put(self, topic: str, data: bytes | Callable[[], Any], at_ns: int, size: int = SMALL_BYTES) -> bool:
        size = len(data) if isinstance(data, bytes) else size
        return self._writer.put(Entry(topic, self._wall_ns(at_ns), data, size))

    def _show(self, topic: str, make: Callable[[Any], Any], at_ns: int, size: int = SMALL_BYTES) -> None:
        """Record display data, where Foxglove's library is installed."""
        display = self._display
        if display is not None:
            self._put(topic, lambda: make(display), at_ns, size)

    def _wall_ns(self, at_ns: int) -> int:
        return at_ns + self._wall_offset_ns

    def _log(self, record: logging.LogRecord) -> None:
        display, at_ns = self._display, round(time.time() * 1e9)
        if display is not None:
            self._writer.put(Entry(topics.LOG, at_ns, lambda: display.line(record, at_ns), SMALL_BYTES))


def _display() -> Any:
    """Return the converters for display, None without the extra `record`."""
    if extras.missing("record") is not None:
        return None
    from companion.flight.recorder import foxglove_scene

    return foxglove_scene


class _LogHandler(logging.Handler):
    def __init__(self, take: Callable[[logging.LogRecord], None]) -> None:
        super().__init__(logging.INFO)
        self._take = take

    def emit(self, record: logging.LogRecord) -> None:
        self._take(record)
