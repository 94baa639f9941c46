"""Folder of PCD scans named by their times, as the points of a telemetry log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from companion.desk.clouds.crs import from_option
from companion.desk.clouds.pcd import open_pcd
from companion.desk.replay.clouds.cloud_counts import CloudCounts
from companion.desk.replay.clouds.scan_names import stamps_of
from companion.desk.replay.foreign_replay import Act, Rerun
from companion.desk.replay.telemetry.recorder_clock import ClockStep, continuous_time
from companion.flight.sensors.decoders.point_clock import PointClock
from companion.flight.sensors.decoders.point_cloud import StampedCloud, clock_of, decode
from companion.runtime.errors import UsageError


class CloudFolder:
    """Scans in the sensor's axes (forward, left, up); see `LoggedPoints`.

    Points have the time of their file's name, or their own time if a field holds it as in the clouds of a
    bag.

    Raises
    ------
    UsageError
        The folder holds no scan, or a name is no time.
    """

    cut = ""
    bad = 0

    def __init__(self, folder: Path) -> None:
        paths = sorted(folder.glob("*.pcd"))
        if not paths:
            raise UsageError(f"{folder}: it holds no .pcd file")
        self._files = sorted(zip(stamps_of(paths), paths, strict=True))
        self._counts = CloudCounts()
        self._clock = clock_of(_read(*file) for file in self._files)

    def summary(self) -> dict[str, Any]:
        return self._counts.summary(self._clock)

    def steps(self, rerun: Rerun, clock_steps: Sequence[ClockStep]) -> Iterator[tuple[int, Act]]:
        self._counts = CloudCounts()
        recorded = continuous_time(clock_steps, [stamp_ns for stamp_ns, _ in self._files])
        for stamp_ns, path in self._files:
            at_ns = recorded(stamp_ns)
            yield at_ns, partial(self._hand, rerun, stamp_ns, at_ns - stamp_ns, path)

    def _hand(self, rerun: Rerun, stamp_ns: int, later_ns: int, path: Path) -> None:
        clock = self._clock if isinstance(self._clock, PointClock) else None
        decoded = decode(_read(stamp_ns, path).table, stamp_ns, clock)
        if self._counts.add(decoded, clock):
            rerun.add_returns(replace(decoded.returns, stamp_ns=decoded.returns.stamp_ns + later_ns))


def _read(stamp_ns: int, path: Path) -> StampedCloud:
    return StampedCloud(stamp_ns, "", open_pcd(path, _NOWHERE, in_sensor_axes=True).records())


_NOWHERE = from_option("EPSG:4326")  # the reader requires a CRS, though the points are in the sensor's axes
