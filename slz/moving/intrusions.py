"""What comes onto the selected point between two windows: seen in the scan that shows it.

A window becomes a map when it is over, half a second to two seconds after its first return. A car is on the
point in that time. Every scan is therefore compared with the ground that the last window left there.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.frame import LocalFrame, is_known
from slz.landing_point.watched_ground import WatchedGround
from slz.points.outliers import FLIGHT_GROUP, in_cluster
from slz.window import Scan

KEPT_NS = 300_000_000  # returns that count together
SIGMAS = 4.0  # of a height at the end of a ray, that noise explains
FEWEST_GROUND = 30  # returns around the point that tell a shift of all heights
MOST_TOGETHER = 2000  # returns among which groups are sought; more are thinned

Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Intrusion:
    """Something on the selected point that its map does not show.

    height_m: over the ground. enu_m: (3,) its highest return. first_ns, last_ns: stamps of its first and its
    newest return among those kept.
    """

    height_m: float
    enu_m: Points
    first_ns: int
    last_ns: int


class Intrusions:
    """Watch over the selected point.

    A return is one of an intruder if it is higher over the map's ground or objects, within the radius of
    `WatchedGround`, than an obstacle's least height and noise explain. The navigation's height may have
    shifted since the window: the median of the returns around the point is taken off, in which something that
    covers less than half of the ground does not show. Five within 0.6 m and 0.3 s are an intruder, as many as
    make a group of an outlier (`slz.points.outliers`); rain, dust and multipath return single pulses.
    """

    def __init__(self) -> None:
        self._frame: LocalFrame | None = None
        self._enu_m: Points | None = None
        self._kept: deque[tuple[Points, NDArray[np.int64]]] = deque()  # with the height over ground as 4th

    def forget(self) -> None:
        """Drop all returns: a new map begins."""
        self._kept.clear()

    def add(self, scan: Scan, ground: WatchedGround | None) -> Intrusion | None:
        """Compare a scan with the ground at the selected point; return what has come there, or None."""
        if ground is None or not len(scan):
            self.forget()
            return None
        if scan.frame != self._frame or self._enu_m is None or (self._enu_m != ground.enu_m).any():
            self.forget()
        self._frame, self._enu_m = scan.frame, ground.enu_m
        new = _intruders(scan, ground)
        if new is not None:
            self._kept.append(new)
        newest_ns = int(scan.stamp_ns[-1])
        while self._kept and not 0 <= newest_ns - int(self._kept[0][1][0]) <= KEPT_NS:
            self._kept.popleft()
        return self._grouped()

    def _grouped(self) -> Intrusion | None:
        if sum(len(stamps) for _, stamps in self._kept) < FLIGHT_GROUP[1]:
            return None
        points, stamps = (np.concatenate(parts) for parts in zip(*self._kept, strict=True))
        every = -(-len(stamps) // MOST_TOGETHER)
        points, stamps = points[::every], stamps[::every]
        together = in_cluster(np.ascontiguousarray(points[:, :3]), *FLIGHT_GROUP)
        if not together.any():
            return None
        points, stamps = points[together], stamps[together]
        top = int(points[:, 3].argmax())
        return Intrusion(float(points[top, 3]), points[top, :3].copy(), int(stamps.min()), int(stamps.max()))


def _intruders(scan: Scan, ground: WatchedGround) -> tuple[Points, NDArray[np.int64]] | None:
    """Return the returns of intruders (n, 4), with their height over the ground, and their stamps."""
    way = scan.points_enu_m[:, :2] - ground.enu_m[:2]
    away2 = np.einsum("ij,ij->i", way, way)
    reach_m = ground.top_m.shape[0] * ground.cell_m / 2
    near = np.flatnonzero(away2 < reach_m**2)
    if not len(near):
        return None
    points = scan.points_enu_m[near]
    over = ground.over_m(points)
    known = np.isfinite(over)
    shift_m = float(np.median(over[known])) if np.count_nonzero(known) >= FEWEST_GROUND else 0.0
    range_m = np.zeros(len(points))
    if is_known(scan.sensor_enu_m):
        range_m = np.hypot(*(points[:, :2] - scan.sensor_enu_m[:2]).T)
    high = over - shift_m > ground.least_m + SIGMAS * ground.angle_noise_rad * range_m  # False for NaN
    which = high & (away2[near] < ground.radius_m**2)
    if not which.any():
        return None
    return np.column_stack([points[which], over[which] - shift_m]), scan.stamp_ns[near[which]]
