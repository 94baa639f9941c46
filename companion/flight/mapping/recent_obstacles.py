"""Buffer of recent returns around the vehicle."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from companion.flight.geometry.axes import PoseLike, enu_from_level
from slz import ReturnKind, Scan, SpeckDetector
from slz.airborne.specks import MOST_WAITING
from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel

Floats = NDArray[np.float64]

BELOW_M = 1.0
FEWEST = 5
CAPACITY = 1 << 16
THIN = 7  # keeps one return in 7: coprime to the number of lasers, so that every laser contributes
Stamps = Array1D[np.int64]


class RecentObstacles:
    """Returns of the last seconds in the map frame, which the map does not show yet, without specks.

    A window becomes a map a second or two after it was seen. Returns of objects are thinned; memory and time
    are bounded by a ring buffer of `CAPACITY` returns, read by kernels. Of the undecided returns that
    `specks` has now, those that came back count, and are not thinned, since a wire may have no others.

    Attributes
    ----------
    newest_ns
        Stamp of the newest return, None before the first.
    """

    def __init__(self, specks: SpeckDetector | None = None, *, keep_s: float = 2.0, thin: int = THIN) -> None:
        self._specks = specks or SpeckDetector()
        self._keep_ns = round(keep_s * 1e9)
        self._thin, self._skip = thin, 0
        self._points = np.zeros((CAPACITY, 3))
        self._stamps = np.full(CAPACITY, np.iinfo(np.int64).min // 2)
        self._next = 0
        self._out = np.empty((CAPACITY + MOST_WAITING, 3))
        self.newest_ns: int | None = None

    def add(self, scan: Scan) -> None:
        """Add the returns of objects in a scan; one of specks alone is a sign of life."""
        if not len(scan):
            return
        self.newest_ns = int(scan.stamp_ns[-1])
        points, stamps = scan.points_enu_m, scan.stamp_ns
        if scan.kinds is not None:
            of_object = scan.kinds == ReturnKind.OBJECT
            points, stamps = points[of_object], stamps[of_object]
        some = slice(self._skip, None, self._thin)
        self._skip = (self._skip - len(points)) % self._thin
        points, stamps = points[some], stamps[some]
        while len(points):
            room = CAPACITY - self._next
            self._points[self._next : self._next + len(points)] = points[:room]
            self._stamps[self._next : self._next + len(points)] = stamps[:room]
            self._next = (self._next + min(room, len(points))) % CAPACITY
            points, stamps = points[room:], stamps[room:]

    def forget(self) -> None:
        """Drop all returns: the position estimate moved."""
        self._specks.forget()
        self._stamps[:] = np.iinfo(np.int64).min // 2
        self.newest_ns = None

    def level_frd_m(self, pose: PoseLike, now_ns: int) -> Floats:
        """Return the recent returns (n, 3) in level forward-right-down relative to the vehicle, m.

        The array is overwritten by the next call.
        """
        oldest = now_ns - self._keep_ns
        axes = np.ascontiguousarray(enu_from_level(pose))
        n = 0
        for points, stamps in (self._specks.seen_again, (self._points, self._stamps)):
            n += levelled(points, stamps, oldest, pose.position_enu_m, axes, self._out[n:])
        return self._out[:n]

    def ground_below_m(self, position_enu_m: Floats, now_ns: int) -> float:
        """Return the median height of the returns below a position, NaN where there are too few."""
        oldest = now_ns - self._keep_ns
        heights = self._out.reshape(-1)
        n = heights_below(
            self._points, self._stamps, oldest, position_enu_m[0], position_enu_m[1], BELOW_M, heights
        )
        return math.nan if n < FEWEST else float(np.median(heights[:n]))


@kernel
def levelled(
    points: Array2D[np.float64],
    stamps: Stamps,
    oldest_ns: int,
    origin: Array1D[np.float64],
    axes: Array2D[np.float64],
    out: Array2D[np.float64],
) -> int:
    """Write points since `oldest_ns` relative to an origin, in axes given by columns; return the count."""
    n = 0
    for i in range(len(stamps)):
        if stamps[i] >= oldest_ns:
            x, y, z = points[i, 0] - origin[0], points[i, 1] - origin[1], points[i, 2] - origin[2]
            for k in range(3):
                out[n, k] = x * axes[0, k] + y * axes[1, k] + z * axes[2, k]
            n += 1
    return n


@kernel
def heights_below(
    points: Array2D[np.float64],
    stamps: Stamps,
    oldest_ns: int,
    east: float,
    north: float,
    radius: float,
    out: Array1D[np.float64],
) -> int:
    """Write the heights of the points since `oldest_ns` within a radius; return the count."""
    n = 0
    for i in range(len(stamps)):
        if stamps[i] >= oldest_ns:
            x, y = points[i, 0] - east, points[i, 1] - north
            if x * x + y * y < radius * radius:
                out[n] = points[i, 2]
                n += 1
    return n
