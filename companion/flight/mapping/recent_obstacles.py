"""What was seen around the vehicle a moment ago."""

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
THIN = 7  # one return of so many is kept: prime to the number of lasers, or some of them would never be


class ObstacleMemory:
    """Returns of the last seconds, thinned, in the map frame: what the map does not show yet.

    Windows become a map a second or two after they were seen. Memory and time are bounded: a ring of
    `CAPACITY` returns, walked by kernels.

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
        """Remember a scan."""
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
        """Forget everything: the position estimate was moved."""
        self._stamps[:] = np.iinfo(np.int64).min // 2
        self.newest_ns = None

    def level_frd_m(self, pose: PoseLike, now_ns: int) -> Floats:
        """Return (n, 3) forward, right, down of the vehicle, level, of the returns still remembered.

        The array is overwritten by the next call.
        """
        oldest = now_ns - self._keep_ns
        axes = np.ascontiguousarray(enu_from_level(pose))
        n = levelled(self._points, self._stamps, oldest, pose.position_enu_m, axes, self._out)
        return self._out[:n]

    def ground_below_m(self, position_enu_m: Floats, now_ns: int) -> float:
        """Return the median height of the returns below a position, NaN where too few fell there."""
        oldest = now_ns - self._keep_ns
        heights = self._out.reshape(-1)
        n = heights_below(
            self._points, self._stamps, oldest, position_enu_m[0], position_enu_m[1], BELOW_M, heights
        )
        return math.nan if n < FEWEST else float(np.median(heights[:n]))
