"""Recording type of a file, and the opening of other programs' recordings with their companion files."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

import params
from companion.desk.replay.captures.captured_packets import CapturedPackets
from companion.desk.replay.cloud_folder import CloudFolder
from companion.desk.replay.foreign_replay import Feed, Rerun
from companion.desk.replay.recorder_clock import ContinuousTime
from companion.desk.replay.ros.mcap_stream import is_bag
from companion.desk.replay.ros.ros_feed import LEVEL_MOUNT, RosFeed
from companion.desk.replay.stored_cloud import StoredCloud
from companion.desk.replay.telemetry_feed import TelemetryFeed, clock_steps
from companion.desk.replay.telemetry_log import TelemetryLog, tells_fix, vehicle_of
from companion.runtime.errors import UsageError
from params import Parameters
from slz import LocalFrame

Kind = Literal["own", "bag", "tlog"]
CAPTURES = frozenset({".pcap", ".pcapng", ".cap"})
PLACED = frozenset({".las", ".laz"})
CLOUDS = frozenset({".pcd", ".ply", ".xyz"})
BESIDE_LOG = "a capture (.pcap), a georeferenced cloud (.laz), or a folder of .pcd files named by their times"


@dataclass(frozen=True, slots=True)
class RecordingOptions:
    """Options for a recording of another program.

    points: topic of the points, or path of the points of a log. poses: topics. lidar: kind of the sensor.
    origin: latitude, longitude, altitude of the local frame's origin. profile: of the parameters. system:
    ID of the vehicle in a log of several. vertical_unit: of the heights of a cloud.
    """

    points: str | None = None
    poses: tuple[str, ...] = ()
    lidar: str | None = None
    origin: str | None = None
    profile: str = "quadcopter"
    system: int | None = None
    vertical_unit: str | None = None

    @property
    def is_empty(self) -> bool:
        return self == RecordingOptions(profile=self.profile)


def recording_type_of(path: Path) -> Kind:
    """Return the type of a recording, from its name; for MCAP from the file's profile and schemas."""
    suffix = path.suffix.lower()
    if path.is_dir() or suffix in (".db3", ".bag"):
        return "bag"
    if suffix == ".tlog":
        return "tlog"
    return "bag" if suffix == ".mcap" and is_bag(path) else "own"


def open_recording(path: Path, settings: Iterable[str], options: RecordingOptions) -> tuple[Feed, Rerun]:
    """Open a recording of another program.

    Raises
    ------
    UsageError
        It cannot be used, or an option is missing, wrong or superfluous.
    """
    settings = tuple(settings)
    parameters = params.load(options.profile, settings)
    if recording_type_of(path) == "tlog":
        return _telemetry(path, options), Rerun(parameters)
    return _bag(path, settings, options, parameters)


def _bag(
    path: Path, settings: tuple[str, ...], options: RecordingOptions, parameters: Parameters
) -> tuple[Feed, Rerun]:
    if options.lidar is not None:
        raise UsageError(f"{path}: --lidar goes with packets, not with the points of a bag")
    if options.system is not None:
        raise UsageError(f"{path}: --system goes with a telemetry log, not with a bag")
    feed = RosFeed(path, options.points, options.poses)
    if feed.is_local and options.origin is None:
        raise UsageError(
            f"{path}: its poses are metres of a frame of their own: say where that begins by"
            " --origin LAT,LON,ALT"
        )
    if not feed.is_local and options.origin is not None:
        raise UsageError(f"{path}: its poses are latitudes and longitudes: leave out --origin")
    if feed.body_points and not any(setting.startswith("lidar_") for setting in settings):
        parameters = parameters.model_copy(update=LEVEL_MOUNT)
    return feed, Rerun(parameters, None if options.origin is None else _frame(options.origin))


def _telemetry(path: Path, options: RecordingOptions) -> Feed:
    if options.poses or options.origin is not None:
        raise UsageError(f"{path}: it tells where the vehicle was: leave out --pose and --origin")
    if options.points is None:
        raise UsageError(f"{path}: name what the LiDAR measured by --points: {BESIDE_LOG}")
    log, points = TelemetryLog(path), Path(options.points)
    placed, folder = points.suffix.lower() in PLACED, points.is_dir()
    if options.lidar is not None and (placed or folder):
        raise UsageError(f"{points}: --lidar goes with packets, not with points")
    system = vehicle_of(path, log, options.system)
    vehicle = system, tells_fix(log, system)
    if placed:
        return TelemetryFeed(log, StoredCloud(points, _span_ns(log, system), options.vertical_unit), *vehicle)
    if folder:
        return TelemetryFeed(log, CloudFolder(points), *vehicle)
    if points.suffix.lower() in CLOUDS:
        raise UsageError(f"{points}: it does not say when it was measured: give {BESIDE_LOG}")
    return TelemetryFeed(log, CapturedPackets(points, options.lidar), *vehicle)


def _span_ns(log: TelemetryLog, system: int | None) -> tuple[int, int]:
    """Return the first and the last time of a log."""
    recorded = ContinuousTime(clock_steps(log, system))
    times = np.fromiter((recorded(logged.at_ns) for logged in log.messages()), np.int64)
    return int(times.min()), int(times.max())


def _frame(text: str) -> LocalFrame:
    try:
        lat, lon, alt = (float(part) for part in text.split(","))
        return LocalFrame(lat, lon, alt)
    except ValueError:
        raise UsageError(f"--origin {text!r}: write LAT,LON,ALT in degrees and metres") from None
