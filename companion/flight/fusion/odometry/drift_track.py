"""Drift of the autopilot's position off the map within the last ten seconds."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
DRIFT_NS, DRIFT_STEP_NS = 10_000_000_000, 500_000_000


class DriftTrack:
    """Horizontal shifts of the correction, each half second of the last ten while the place is known."""

    def __init__(self) -> None:
        self._track: deque[tuple[int, Floats]] = deque()

    def add(self, at_ns: int, shift_m: Floats, observed: bool) -> None:
        """Note a horizontal shift (2,); forget all while the place is not known."""
        track = self._track
        if not observed:
            track.clear()
            return
        while track and at_ns - track[0][0] > DRIFT_NS:
            track.popleft()
        if len(track) < 2 or at_ns - track[-2][0] >= DRIFT_STEP_NS:
            track.append((at_ns, shift_m))
        else:
            track[-1] = at_ns, shift_m

    def clear(self) -> None:
        """Forget all shifts."""
        self._track.clear()

    @property
    def drift_m(self) -> float:
        """Greatest distance of the shifts from the newest one, m."""
        if len(self._track) < 2:
            return 0.0
        places = np.array([place for _, place in self._track])
        return float(np.linalg.norm(places - places[-1], axis=1).max())
