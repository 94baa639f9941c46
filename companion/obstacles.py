"""What was seen around the vehicle a moment ago."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from slz import Scan


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
