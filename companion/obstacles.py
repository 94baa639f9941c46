"""What was seen around the vehicle a moment ago."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from slz import Scan

BELOW_M = 1.0
FEWEST = 5


class ObstacleMemory:
    """Returns of the last second, thinned, in the map frame.

    A LiDAR that looks down does not see what the vehicle turns away from; what was there a moment ago is
    still there.
    """

    def __init__(self, keep_s: float = 1.0, thin: int = 8) -> None:
        self._keep_ns = round(keep_s * 1e9)
        self._thin = thin
        self._scans: deque[tuple[int, NDArray[np.float64]]] = deque()

    def add(self, scan: Scan) -> None:
        """Remember a scan."""
        if len(scan):
            self._scans.append((int(scan.stamp_ns[-1]), scan.points_enu_m[:: self._thin]))

    def points_enu_m(self, now_ns: int) -> NDArray[np.float64]:
        """Return the (n, 3) returns still remembered."""
        while self._scans and now_ns - self._scans[0][0] > self._keep_ns:
            self._scans.popleft()
        if not self._scans:
            return np.zeros((0, 3))
        return np.concatenate([points for _, points in self._scans])

    def height_above_ground_m(self, position_enu_m: NDArray[np.float64], now_ns: int) -> float:
        """Return the height over the returns below the vehicle, NaN where too few fell there."""
        points = self.points_enu_m(now_ns)
        below = np.hypot(*(points[:, :2] - position_enu_m[:2]).T) < BELOW_M
        if np.count_nonzero(below) < FEWEST:
            return float("nan")
        return float(position_enu_m[2] - np.median(points[below, 2]))
