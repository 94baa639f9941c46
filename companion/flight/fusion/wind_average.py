"""Mean wind and gust from winds averaged over 3 s."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from companion.flight.geometry.wind import Wind, WindSource

Floats = NDArray[np.float64]

MEAN_S = 30.0
GUST_NS = 60_000_000_000
SETTLED_NS = 5_000_000_000
STALE_NS = 5_000_000_000


class WindAverage:
    """Exponential mean over 30 s, and gust, of one source.

    The gust is that of the WMO, the greatest mean over 3 s (WMO-No. 8, Part I, 5.1), here of the last minute
    instead of ten, because the present weather decides a landing. In the first 30 s, all of the time has
    the same weight.

    Parameters
    ----------
    tells_gusts
        False for a source that takes manoeuvres for gusts: the gust is then the mean.
    """

    def __init__(self, source: WindSource, *, tells_gusts: bool = True) -> None:
        self._source, self._tells_gusts = source, tells_gusts
        self._mean = np.zeros(2)
        self._begun_ns: int | None = None
        self._newest_ns = 0
        self._gusts: deque[tuple[int, float]] = deque()  # speeds that no later one exceeds

    def clear(self) -> None:
        """Discard the wind."""
        self._begun_ns = None
        self._gusts.clear()

    def add(self, towards_ms: Floats, now_ns: int) -> None:
        """Add a wind (2,) towards east, north, averaged over 3 s."""
        if self._begun_ns is None or not 0 <= now_ns - self._newest_ns <= STALE_NS:
            self.clear()
            self._begun_ns, self._mean = now_ns, towards_ms.copy()
        else:
            elapsed_s = (now_ns - self._newest_ns) * 1e-9
            weight = elapsed_s / min(MEAN_S, max((now_ns - self._begun_ns) * 1e-9, elapsed_s, 1e-3))
            self._mean = self._mean + weight * (towards_ms - self._mean)
        self._newest_ns = now_ns
        speed_ms = float(np.hypot(*towards_ms))
        while self._gusts and self._gusts[-1][1] <= speed_ms:
            self._gusts.pop()
        self._gusts.append((now_ns, speed_ms))

    def at(self, now_ns: int) -> Wind | None:
        """Return the wind; None in the first 5 s, and after 5 s without a new one."""
        begun_ns = self._begun_ns
        if begun_ns is None or now_ns - self._newest_ns > STALE_NS or self._newest_ns - begun_ns < SETTLED_NS:
            return None
        while now_ns - self._gusts[0][0] > GUST_NS:
            self._gusts.popleft()
        east_ms, north_ms = (float(v) for v in self._mean)
        speed_ms = float(np.hypot(east_ms, north_ms))
        gust_ms = max(self._gusts[0][1], speed_ms) if self._tells_gusts else speed_ms
        return Wind.of_velocity(east_ms, north_ms, gust_ms, self._source)
