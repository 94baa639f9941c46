"""Intrusions onto the selected point, reported with the scan that shows them.

A window becomes a map when it is over, half a second to two seconds after its first return. A car is on the
point in that time. Every scan is therefore compared with the ground that the last window left there.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from slz.frame import LocalFrame
from slz.kernels.points.over_patch import find_intruders
from slz.landing_point.watched_ground import WatchedGround
from slz.moving.common_shift import OverPatch
from slz.points.outliers import FLIGHT_GROUP, OBJECT_M2
from slz.window import Scan

KEPT_NS = 300_000_000  # returns that count together
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


@dataclass(frozen=True, slots=True)
class _Raised:
    """Returns of intruders in a scan, their heights over ground and ranges (m); its rays, its last stamp."""

    points: Points
    over_m: Points
    range_m: Points
    stamp_ns: NDArray[np.int64]
    n_rays: int
    last_ns: int


class Intrusions:
    """Watch over the selected point.

    A return is one of an intruder if it is higher over the map's ground or objects than an obstacle's least
    height and noise explain, within footprint and touchdown error of the point; within rotor and tail, if it
    reaches up to these. Height and tilt of all ground may have shifted since the window: the plane of the
    even cells around what is watched is taken off, each at its lowest return. Five returns within 0.6 m and
    0.3 s are an intruder, as many as outlier removal asks of a group. Near the sensor, where rain, dust
    and snow are dense, it takes as many as an object of `OBJECT_M2` would return (`slz.points.outliers`).
    """

    def __init__(self) -> None:
        self._frame: LocalFrame | None = None
        self._place_m: Points | None = None
        self._kept: deque[_Raised] = deque()

    def forget(self) -> None:
        """Drop all returns: a new map begins."""
        self._kept.clear()

    def add(self, scan: Scan, ground: WatchedGround | None) -> Intrusion | None:
        """Compare a scan with the ground at the selected point; return what has come there, or None."""
        if ground is None or not len(scan):
            self.forget()
            return None
        place_m = ground.enu_m[:2]
        if scan.frame != self._frame or self._place_m is None or (self._place_m != place_m).any():
            self.forget()
        self._frame, self._place_m = scan.frame, place_m
        self._kept.append(_raised(scan, ground))
        newest_ns = int(scan.stamp_ns[-1])
        while not 0 <= newest_ns - self._kept[0].last_ns <= KEPT_NS:
            self._kept.popleft()
        return self._grouped()

    def _grouped(self) -> Intrusion | None:
        if sum(len(kept.stamp_ns) for kept in self._kept) < FLIGHT_GROUP[1]:
            return None
        points = np.concatenate([kept.points for kept in self._kept])
        over, range_m = (np.concatenate([getattr(k, n) for k in self._kept]) for n in ("over_m", "range_m"))
        stamps = np.concatenate([kept.stamp_ns for kept in self._kept])
        every = -(-len(stamps) // MOST_TOGETHER)
        points, over, range_m, stamps = points[::every], over[::every], range_m[::every], stamps[::every]
        rays = sum(kept.n_rays for kept in self._kept) / every
        needed = np.maximum(FLIGHT_GROUP[1], rays * OBJECT_M2 / (4 * math.pi * np.maximum(range_m, 0.1) ** 2))
        around = cKDTree(points).query_ball_point(points, FLIGHT_GROUP[0], return_length=True)
        together = around >= needed
        if not together.any():
            return None
        points, over, stamps = points[together], over[together], stamps[together]
        top = int(over.argmax())
        return Intrusion(float(over[top]), points[top].copy(), int(stamps.min()), int(stamps.max()))


def _raised(scan: Scan, ground: WatchedGround) -> _Raised:
    """Return the returns of intruders in a scan."""
    points, place = np.ascontiguousarray(scan.points_enu_m), np.ascontiguousarray(ground.enu_m)
    around = float(place[0]), float(place[1]), ground.radius_m, math.inf
    over = OverPatch.of(points, ground, ground.top_m, around)
    range_m = np.empty(len(over.index))
    n = find_intruders(
        points, np.ascontiguousarray(scan.sensor_enu_m), over.index, over.heights_m, over.shift_m(), place,
        (ground.footprint_m, ground.least_m), (ground.radius_m, ground.disc_least_m),
        ground.angle_noise_rad, ground.range_noise_m, range_m,
    )  # fmt: skip
    which, last_ns = over.index[:n], int(scan.stamp_ns[-1])
    stamps = scan.stamp_ns[which]
    return _Raised(points[which], over.heights_m[:n].copy(), range_m[:n].copy(), stamps, len(scan), last_ns)
