"""Check of the stated boresight in flight, by ground that the vehicle sees under several headings."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from companion.flight.fusion.boresight_views import View, estimate
from companion.flight.fusion.pose_history import PoseHistory
from slz import Scan

VIEW_NS = 1_000_000_000  # whose returns are a view
MOST_RETURNS = 1000  # of a view, evenly thinned
REACH_M = 25.0  # over ground, of returns
MOST_SWING_RAD = math.radians(20.0)  # of the heading within a view
TURNED_RAD, MOVED_M = math.radians(30.0), 8.0  # from every other view, of one that tells something new
MOST_VIEWS = 10
SURE_SIGMAS = 5.0

Floats = NDArray[np.float64]


class BoresightCheck:
    """Views of the flight so far, and the boresight's error that they show.

    Attributes
    ----------
    error_deg
        Certain error of the stated mount in roll and pitch, deg, as last known; None before.
    """

    def __init__(self) -> None:
        self.error_deg: tuple[float, float] | None = None
        self._views: deque[View] = deque(maxlen=MOST_VIEWS)
        self._scans: list[Scan] = []  # of the next view
        self._epoch = 0

    def add(self, scan: Scan, history: PoseHistory) -> None:
        """Take a scan as the autopilot's poses place it; compare a second's returns with those of before."""
        end_ns = int(scan.stamp_ns[-1])
        if history.epoch != self._epoch:
            self._epoch = history.epoch
            self._views.clear()
            self._scans.clear()
        if self._scans and not 0 <= end_ns - int(self._scans[0].stamp_ns[0]) < 2 * VIEW_NS:
            self._scans.clear()
        self._scans.append(scan)
        since_ns = int(self._scans[0].stamp_ns[0])
        if end_ns - since_ns < VIEW_NS:
            return
        poses = history.interpolate(np.array([since_ns, (since_ns + end_ns) // 2, end_ns]))
        scans, self._scans = self._scans, []
        if poses.valid.all():
            self._compare(scans, poses.rotation_enu_from_frd)

    def _compare(self, scans: list[Scan], rotations: Floats) -> None:
        """Add the view of a second if it shows anything new, and estimate the boresight's error."""
        step = -(-sum(len(scan) for scan in scans) // MOST_RETURNS)
        parts = [scan.points_enu_m[::step] for scan in scans]
        points = np.concatenate(parts)
        sensors = np.repeat([scan.sensor_enu_m for scan in scans], [len(part) for part in parts], axis=0)
        way = (points - sensors)[:, :2]
        near = np.einsum("ij,ij->i", way, way) < REACH_M**2
        swing = math.remainder(_heading_rad(rotations[2]) - _heading_rad(rotations[0]), 2 * math.pi)
        if abs(swing) > MOST_SWING_RAD or not near.any():
            return
        view = View.of(points[near], sensors[near], rotations[1])
        if not all(_differ(view, other) for other in self._views):
            return
        self._views.append(view)
        found = estimate(list(self._views))
        if found is not None and found.sigmas > SURE_SIGMAS:
            self.error_deg = float(found.error_deg[0]), float(found.error_deg[1])


def _heading_rad(rotation_enu_from_frd: Floats) -> float:
    return math.atan2(rotation_enu_from_frd[1, 0], rotation_enu_from_frd[0, 0])


def _differ(view: View, other: View) -> bool:
    turned_rad = abs(math.remainder(view.heading_rad - other.heading_rad, 2 * math.pi))
    away_m = float(np.linalg.norm(view.sensor_enu_m - other.sensor_enu_m))
    return turned_rad >= TURNED_RAD or away_m >= MOVED_M
