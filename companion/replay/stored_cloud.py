"""A georeferenced cloud (LAS, LAZ) beside a telemetry log: placed points, with their times."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyproj import Transformer

from companion.errors import UsageError
from companion.replay.rerun import Act, Rerun
from companion.survey.cloud import Cloud, read
from companion.survey.las import open_las
from companion.survey.source import Clock
from slz import Scan

SCAN_NS = 50_000_000
GPS_EPOCH_S = 315_964_800  # 1980-01-06 since 1970
# From a time of day on (s since 1970), GPS time is so far ahead of UTC (IERS Bulletin C).
LEAPS_S = (
    (1_136_073_600, 14),
    (1_230_768_000, 15),
    (1_341_100_800, 16),
    (1_435_708_800, 17),
    (1_483_228_800, 18),
)
WEEK_S = 604_800
STANDARD_LESS_S = 1_000_000_000  # standard GPS time of LAS is given less this


class StoredCloud:
    """Points of FILE.laz; see `LoggedPoints`.

    Heights are taken to be above the datum that the vehicle's altitudes are above, the mean sea level.

    Parameters
    ----------
    near_ns
        A time of day of the flight: tells the week, where the cloud's times are of the week.
    vertical_unit
        Unit of the heights that the user named, m, ft or us-ft: overrides what the file says.

    Raises
    ------
    UsageError
        The file cannot be used, or its points have no times.
    """

    cut = ""
    bad = 0

    def __init__(self, path: Path, near_ns: int, vertical_unit: str | None = None) -> None:
        clock = open_las(path, None, vertical_unit).clock
        cloud = read([path], vertical_unit=vertical_unit)
        if clock is None or cloud.gps_s is None or not np.isfinite(cloud.gps_s).all():
            raise UsageError(f"{path}: its points have no times, which tie them to the flight: use slz map")
        stamps = since_1970_ns(cloud.gps_s, clock, near_ns)
        order = np.argsort(stamps, kind="stable")
        self._stamp_ns = stamps[order]
        self._lla = _lla(path, cloud)[order]
        self._reference = cloud.reference.name
        self._without_frame = 0

    def told(self) -> dict[str, Any]:
        return {"crs": self._reference, "points": len(self._stamp_ns), "before_position": self._without_frame}

    def steps(self, rerun: Rerun) -> Iterator[tuple[int, Act]]:
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
        rerun.add_placed(Scan(points, stamps, sensor, frame))


def since_1970_ns(gps_s: NDArray[np.float64], clock: Clock, near_ns: int) -> NDArray[np.int64]:
    """Return the times of day, ns since 1970, of times of GPS; `near_ns` is one of the same week."""
    near_s = near_ns // 1_000_000_000
    begin_s = GPS_EPOCH_S - max((leap for since, leap in LEAPS_S if since <= near_s), default=LEAPS_S[0][1])
    if clock == "standard":
        begin_s += STANDARD_LESS_S
    else:
        begin_s += round((near_s - begin_s - float(np.median(gps_s))) / WEEK_S) * WEEK_S
    whole = np.floor(gps_s)
    part_ns = np.rint((gps_s - whole) * 1e9).astype(np.int64)
    return (whole.astype(np.int64) + begin_s) * 1_000_000_000 + part_ns


def _lla(path: Path, cloud: Cloud) -> NDArray[np.float64]:
    """Return latitude, longitude (degrees) and altitude (m) of points, (n, 3)."""
    to_wgs84 = Transformer.from_crs(cloud.reference.horizontal, "EPSG:4326", always_xy=True)
    lon, lat = to_wgs84.transform(cloud.points[:, 0], cloud.points[:, 1])
    lla = np.column_stack([lat, lon, cloud.points[:, 2] * cloud.reference.vertical_m])
    if not np.isfinite(lla).all():
        raise UsageError(f"{path}: points are not on the Earth in {cloud.reference.name}")
    return lla
