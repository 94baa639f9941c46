"""Returns of several windows that may be of wires: raised, and neither part of a surface nor of a volume."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.column_table import ColumnTable

MOST = 1536  # returns kept
MOST_OF_WINDOW = 384
MAX_AGE_S = 120.0
PLACE_M = 0.25  # cells in which one return of a window is kept

Floats = NDArray[np.float64]


@dataclass(slots=True)
class WireCandidates(ColumnTable):
    """Returns (n, 3), standard deviations (n,) of their places, and when they were seen.

    window: (n,) number of the window. sensors_enu_m: (n, 3) positions of the sensor.
    """

    points_enu_m: Floats
    sigma_m: Floats
    seen_s: Floats
    window: NDArray[np.int64]
    sensors_enu_m: Floats

    def __len__(self) -> int:
        return len(self.sigma_m)

    @classmethod
    def none(cls) -> WireCandidates:
        """Return no returns."""
        return cls(np.empty((0, 3)), np.empty(0), np.empty(0), np.empty(0, np.int64), np.empty((0, 3)))

    @classmethod
    def of(
        cls, points_enu_m: Floats, sigma_m: Floats, now_s: float, window: int, sensor_enu_m: Floats
    ) -> WireCandidates:
        """Return the returns of a window."""
        n = len(points_enu_m)
        sensors = np.tile(sensor_enu_m, (n, 1))
        return cls(points_enu_m, sigma_m, np.full(n, now_s), np.full(n, window), sensors)

    def thinned(self) -> WireCandidates:
        """Return one return for each cell of `PLACE_M`, and no more than `MOST_OF_WINDOW`."""
        if len(self) < 2:
            return self
        cells = np.floor(self.points_enu_m / PLACE_M).astype(np.int64)
        keys = (cells[:, 0] * 73856093) ^ (cells[:, 1] * 19349663) ^ (cells[:, 2] * 83492791)
        first = np.sort(np.unique(keys, return_index=True)[1])
        return self.some(first[:: -(-len(first) // MOST_OF_WINDOW)])

    def bounded(self, now_s: float) -> WireCandidates:
        """Return the newest `MOST` that are not too old."""
        fresh = self.some(now_s - self.seen_s <= MAX_AGE_S)
        return fresh.some(slice(max(0, len(fresh) - MOST), None))
