"""Buffer of recent returns around the vehicle."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from companion.flight.geometry.axes import PoseLike, enu_from_level
from companion.flight.mapping.obstacle_ring import heights_below, levelled
from slz import Scan

Floats = NDArray[np.float64]

BELOW_M = 1.0
FEWEST = 5
CAPACITY = 1 << 16
THIN = 7  # keeps one return in 7: coprime to the number of lasers, so that every laser contributes


class RecentObstacles:
    """Thinned returns of the last seconds in the map frame, which the map does not show yet.

    A window becomes a map a second or two after it was seen. Memory and time are bounded by a ring buffer of
    `CAPACITY` returns, read by kernels.

    Attributes
    ----------
    newest_ns
        Stamp of the newest return, None before the first.
    """

    def __init__(self, keep_s: float = 2.0, thin: int = THIN) -> None:
        self._keep_ns = round(keep_s * 1e9)
        self._thin, self._skip = thin, 0
        self._points = np.zeros((CAPACITY, 3))
        self._stamps = np.full(CAPACITY, np.iinfo(np.int64).min // 2)
        self._next = 0
        self._out = np.empty((CAPACITY, 3))
        self.newest_ns: int | None = None

    def add(self, scan: Scan) -> None:
        """Add the returns of a scan."""
        if not len(scan):
            return
        some = slice(self._skip, None, self._thin)
        self._skip = (self._skip - len(scan)) % self._thin
        points, stamps = scan.points_enu_m[some], scan.stamp_ns[some]
        while len(points):
            room = CAPACITY - self._next
            self._points[self._next : self._next + len(points)] = points[:room]
            self._stamps[self._next : self._next + len(points)] = stamps[:room]
            self._next = (self._next + min(room, len(points))) % CAPACITY
            points, stamps = points[room:], stamps[room:]
        self.newest_ns = int(scan.stamp_ns[-1])

    def forget(self) -> None:
        """Drop all returns: the position estimate moved."""
        self._stamps[:] = np.iinfo(np.int64).min // 2
        self.newest_ns = None

    def level_frd_m(self, pose: PoseLike, now_ns: int) -> Floats:
        """Return the recent returns (n, 3) in level forward-right-down relative to the vehicle, m.

        The array is overwritten by the next call.
        """
        oldest = now_ns - self._keep_ns
        axes = np.ascontiguousarray(enu_from_level(pose))
        n = levelled(self._points, self._stamps, oldest, pose.position_enu_m, axes, self._out)
        return self._out[:n]

    def ground_below_m(self, position_enu_m: Floats, now_ns: int) -> float:
        """Return the median height of the returns below a position, NaN where there are too few."""
        oldest = now_ns - self._keep_ns
        heights = self._out.reshape(-1)
        n = heights_below(
            self._points, self._stamps, oldest, position_enu_m[0], position_enu_m[1], BELOW_M, heights
        )
        return math.nan if n < FEWEST else float(np.median(heights[:n]))
