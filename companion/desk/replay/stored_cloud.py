"""Georeferenced cloud (LAS, LAZ) with point times, as the points of a telemetry log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyproj import Transformer

from companion.desk.clouds.cloud import GeoreferencedCloud, read
from companion.desk.clouds.cloud_source import Clock
from companion.desk.clouds.las import open_las
from companion.desk.replay.foreign_replay import Act, Rerun
from companion.desk.replay.gps_time import NAMES, first_by_header, resolve_times, span_by_header
from companion.desk.replay.recorder_clock import ClockStep, fitting_offset, time_of_day
from companion.desk.survey.cloud_quality import check_steps
from companion.runtime.errors import UsageError
from slz import Scan

SCAN_NS = 50_000_000
DEGREE_M = 111_320.0  # of longitude at the equator, the longest


class StoredCloud:
    """Points of FILE.laz; see `LoggedPoints`.

    Heights must be above mean sea level, the datum of the vehicle's altitudes; those of a cloud that does not
    name its datum are taken for such.

    Parameters
    ----------
    span_ns
        First and last time of day of the flight's log.
    vertical_unit
        Unit of the heights of the user, m, ft or us-ft; overrides the file's.

    Raises
    ------
    UsageError
        The file cannot be used, its points have no times, or none of them is within the flight.
    """

    cut = ""
    bad = 0

    def __init__(self, path: Path, span_ns: tuple[int, int], vertical_unit: str | None = None) -> None:
        clock = open_las(path, None, vertical_unit).clock
        cloud = read([path], vertical_unit=vertical_unit, with_attributes=True)
        if clock is None or cloud.gps_s is None or not np.isfinite(cloud.gps_s).any():
            raise UsageError(f"{path}: its points have no times, which tie them to the flight: use slz map")
        if cloud.reference.is_ellipsoidal:
            raise UsageError(
                f"{path}: its heights are above the ellipsoid ({cloud.reference.name}), those of the log"
                " above mean sea level, up to 107 m apart: convert it, or use slz map, which needs no log"
            )
        times = resolve_times(cloud.gps_s, clock, span_ns)
        if not times.fits.any():
            raise UsageError(
                f"{path}: none of its {len(cloud.gps_s)} points was measured during the flight, which the log"
                f" tells to be from {' to '.join(map(time_of_day, span_ns))}: by its header its times begin"
                f" with {first_by_header(cloud.gps_s, clock, span_ns)}{_offset(cloud.gps_s, clock, span_ns)}"
            )
        order = np.argsort(times.stamp_ns, kind="stable")
        order = order[times.fits[order]]
        self._stamp_ns = times.stamp_ns[order]
        self._lla = _lla(path, cloud)[order]
        self._attributes = None if cloud.attributes is None else cloud.attributes.select(order)
        self._outside = len(times.fits) - len(order)
        self._clock, self._header = times.kind, clock
        self._path, self._scales = path, cloud.scales
        self._reference = cloud.reference
        self._without_frame = 0
        self._above = self._compared = 0

    def summary(self) -> dict[str, Any]:
        return {
            "crs": self._reference.name,
            "points": len(self._stamp_ns) + self._outside,
            "points_outside_log": self._outside,
            "before_position": self._without_frame,
            "points_above_vehicle": self._above,
            "points_beside_vehicle": self._compared,
            "vertical_datum": self._reference.heights,
            "times": NAMES[self._clock],
            "times_in_header": NAMES[self._header],
        }

    def steps(self, rerun: Rerun, _clock_steps: Sequence[ClockStep]) -> Iterator[tuple[int, Act]]:
        unit_m = self._reference.unit_m or DEGREE_M
        lengths_m = unit_m, unit_m, self._reference.vertical_m
        check_steps(str(self._path), self._scales, lengths_m, rerun.parameters)
        begin = 0
        while begin < len(self._stamp_ns):
            end_ns = int(self._stamp_ns[begin]) + SCAN_NS
            end = int(np.searchsorted(self._stamp_ns, end_ns))
            yield int(self._stamp_ns[end - 1]), partial(self._hand, rerun, slice(begin, end))
            begin = end

    def _hand(self, rerun: Rerun, part: slice) -> None:
        frame = rerun.history.frame
        if frame is None:
            self._without_frame += part.stop - part.start
            return
        stamps = self._stamp_ns[part].copy()
        pose = rerun.history.latest(int(stamps[-1]))
        sensor = np.full(3, np.nan) if pose is None else np.array(pose.position_enu_m)
        points = np.ascontiguousarray(frame.enu_m(*self._lla[part].T))
        if pose is not None:
            self._compared += len(points)
            self._above += int(np.count_nonzero(points[:, 2] > sensor[2]))
        attributes = None if self._attributes is None else self._attributes.select(part)
        rerun.add_placed(Scan(points, stamps, sensor, frame, attributes=attributes))


def _offset(gps_s: NDArray[np.float64], clock: Clock, span_ns: tuple[int, int]) -> str:
    """Return the offset that would put the times by the header into the flight; empty if unknown."""
    found = span_by_header(gps_s, clock, span_ns)
    return "" if found is None else f": {fitting_offset(found, span_ns)}"


def _lla(path: Path, cloud: GeoreferencedCloud) -> NDArray[np.float64]:
    """Return latitude, longitude (degrees) and altitude (m) of points, (n, 3)."""
    to_wgs84 = Transformer.from_crs(cloud.reference.horizontal, "EPSG:4326", always_xy=True)
    lon, lat = to_wgs84.transform(cloud.points[:, 0], cloud.points[:, 1])
    lla = np.column_stack([lat, lon, cloud.points[:, 2] * cloud.reference.vertical_m])
    if not np.isfinite(lla).all():
        raise UsageError(f"{path}: points are not on the Earth in {cloud.reference.name}")
    return lla
