"""Uncertainty of the map itself: what was placed by an unsure pose stays as unsure as that pose was."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
STEP_NS = 500_000_000
MOST = 4096  # half an hour; the older half is then thinned to every other one
# Errors that scan and plane share, unknown to the filter: of each generation of the map.
SHARED_M = np.array([0.03, 0.03, 0.05])


class MapUncertainty:
    """Variance of the map's position, east, north, up, by the time at which its parts were placed.

    The filter compares a scan with the map around it. That map was placed by earlier poses, these by the map
    around them, and so on back to the first scan: the variances of this chain add up. Over ground that
    stays in view nothing is added.
    """

    def __init__(self) -> None:
        self._at_ns: list[int] = []
        self._variance_m2: list[Floats] = []

    def variance_m2(self, placed_ns: int) -> Floats:
        """Return the variance (3,), m2, of what was placed at a time; 0 before the first."""
        if not self._at_ns:
            return np.zeros(3)
        index = int(np.searchsorted(self._at_ns, placed_ns, "right")) - 1
        return self._variance_m2[max(index, 0)]

    def add(self, at_ns: int, variance_m2: Floats) -> None:
        """Note the variance (3,) of a pose by which parts of the map are placed now."""
        if self._at_ns and at_ns - self._at_ns[-1] < STEP_NS:
            return
        self._at_ns.append(at_ns)
        self._variance_m2.append(variance_m2)
        if len(self._at_ns) > MOST:
            half = MOST // 2
            self._at_ns[:half] = self._at_ns[:half:2]
            self._variance_m2[:half] = self._variance_m2[:half:2]

    def clear(self) -> None:
        """Forget the map."""
        self._at_ns.clear()
        self._variance_m2.clear()
