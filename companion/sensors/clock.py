"""A sensor's own clock, mapped to the companion's."""

from __future__ import annotations

from collections import deque

WINDOW_NS = 10_000_000_000
BLOCK_NS = 500_000_000
JUMP_NS = 1_000_000_000
MAX_DRIFT = 200e-6


class SensorClock:
    """Offset of a free-running sensor clock by the quickest arrivals.

    A packet can be late but never early, so the smallest difference of arrival and stamp within a block is
    the best offset there; a line through the blocks of the last seconds, kept under all of them, follows the
    drift. A clock that goes back, or leaps by more than a second, starts anew.

    Parameters
    ----------
    delay_ns
        Known fixed delay between measurement and arrival.
    """

    def __init__(self, delay_ns: int = 0) -> None:
        self._delay_ns = delay_ns
        self._blocks: deque[tuple[int, int]] = deque()  # (stamp, smallest arrival - stamp)
        self._last_stamp: int | None = None
        self._drift = 0.0
        self.resets = 0

    def observe(self, stamp_ns: int, arrival_ns: int) -> None:
        """Learn from a packet whose last point has this stamp and which arrived now."""
        difference = arrival_ns - stamp_ns
        if self._last_stamp is not None:
            back = stamp_ns < self._last_stamp - BLOCK_NS
            if back or abs(difference - self._expected(stamp_ns)) > JUMP_NS:
                self._blocks.clear()
                self._drift = 0.0
                self.resets += 1
        self._last_stamp = stamp_ns
        if self._blocks and stamp_ns - self._blocks[-1][0] < BLOCK_NS:
            start, least = self._blocks[-1]
            self._blocks[-1] = (start, min(least, difference))
        else:
            self._blocks.append((stamp_ns, difference))
            while stamp_ns - self._blocks[0][0] > WINDOW_NS:
                self._blocks.popleft()
            self._fit()

    def offset_ns(self, stamp_ns: int) -> int:
        """Return what to add to a sensor stamp."""
        if not self._blocks:
            raise ValueError("no packet was observed yet")
        return self._expected(stamp_ns) - self._delay_ns

    def _expected(self, stamp_ns: int) -> int:
        if not self._blocks:
            return 0
        return min(least + round(self._drift * (stamp_ns - start)) for start, least in self._blocks)

    def _fit(self) -> None:
        """Take the drift from the least of the older half to the least of the newer half."""
        if len(self._blocks) < 8:
            return
        blocks = list(self._blocks)[:-1]
        half = len(blocks) // 2
        first = min(blocks[:half], key=lambda block: block[1])
        second = min(blocks[half:], key=lambda block: block[1])
        slope = (second[1] - first[1]) / (second[0] - first[0])
        self._drift = max(-MAX_DRIFT, min(MAX_DRIFT, slope))
