"""Mapping of a free-running sensor clock to the companion's clock."""

from __future__ import annotations

from collections import deque
from itertools import pairwise

WINDOW_NS = 10_000_000_000
BLOCK_NS = 500_000_000
ENOUGH_NS = 4_000_000_000
JUMP_NS = 800_000_000
REORDERED_NS = 20_000_000
GAP_NS = 100_000_000
MAX_DRIFT = 200e-6
STEP_NS = 5_000_000  # a packet so much earlier than any before it, and by more than a packet: a step
SETTLED_NS = 2_000_000_000  # for so long no packet was earlier than expected by
NEWS_NS = 1_000_000
DRIFT_BLOCKS = 5, 18  # complete blocks that a drift is measured over
SPACING = 0.05  # weight of the newest packet in the usual time from packet to packet
# Least coefficient of determination of that line: on a busy computer five delays are nearly in one by chance.
CERTAIN = 0.999, 0.98

Point = tuple[int, int]  # stamp, arrival - stamp


class SensorClock:
    """Offset of a free-running sensor clock from the packets of least delay.

    A packet can be late but never early, so arrival minus stamp is least for the packets that waited least.
    The minimum of every half second is kept for ten seconds; the line that touches these minima from below
    gives the offset and its drift. Hence no stamp ever maps to a time after its arrival.

    The estimate restarts when the sensor restarts or its clock is set by a second. It does not restart for
    late packets: their stamps continue where the last one ended.

    Parameters
    ----------
    delay_ns
        Known fixed delay between measurement and arrival.

    Attributes
    ----------
    resets
        Number of restarts of the estimate.
    steps
        Number of times that the sensor's clock was set: restarts, and steps forward by 5 ms or more.
    last_step_ns
        Size of the newest step, positive if the clock was set forward.
    """

    def __init__(self, delay_ns: int = 0) -> None:
        self._delay_ns = delay_ns
        self._least: deque[Point] = deque()
        self._block_start = 0
        self._last: tuple[int, int] | None = None  # stamp, arrival
        self._anchor: Point = (0, 0)
        self._drift = 0.0
        self._moved_ns: int | None = None  # arrival of the newest packet earlier than expected
        self._spacing_ns = 0.0
        self.resets = 0
        self.steps = 0
        self.last_step_ns = 0

    @property
    def drift_ppm(self) -> float | None:
        """Rate of the sensor's clock over ours, ppm, over the last 2.5 or 9 s; None if unsure.

        Packets that wait longer and longer look like a slow clock, but not for long and not in a line.
        Where they are read at regular times, their waits can grow in a line, by less than the time from one
        packet to the next: so much is no drift.
        """
        for blocks, certain in zip(DRIFT_BLOCKS, CERTAIN, strict=True):
            points = list(self._least)[-blocks - 1 : -1]
            if len(points) == blocks and points[-1][0] - points[0][0] <= blocks * 2 * BLOCK_NS:
                slope = _slope(points, certain)
                if slope is not None and abs(slope) * (points[-1][0] - points[0][0]) > self._spacing_ns:
                    return -1e6 * slope
        return None

    def is_jump(self, stamp_ns: int, arrival_ns: int) -> bool:
        """Return whether only a jump of the sensor's clock can explain a packet."""
        if self._last is None:
            return False
        step, wait = stamp_ns - self._last[0], arrival_ns - self._last[1]
        return step < -REORDERED_NS or step - wait > JUMP_NS or (step > GAP_NS and wait - step > JUMP_NS)

    def observe(self, stamp_ns: int, arrival_ns: int) -> None:
        """Update the estimate with the stamp of a packet's last point and the packet's arrival."""
        difference, last = arrival_ns - stamp_ns, self._last
        if last is not None and self.is_jump(stamp_ns, arrival_ns):
            self._note_step((stamp_ns - last[0]) - (arrival_ns - last[1]))
            self._least.clear()
            self._moved_ns = last = None
            self.resets += 1
        early_ns = self._line(stamp_ns) - difference if self._least else 0
        if self._moved_ns is None or early_ns > NEWS_NS:
            self._judge_earliness(early_ns, arrival_ns)
        newest_ns = stamp_ns
        if last is not None:
            since_ns = stamp_ns - last[0]
            if 0 < since_ns < GAP_NS:
                self._spacing_ns += SPACING * (since_ns - self._spacing_ns)
            elif since_ns < 0:
                newest_ns = last[0]
        self._last = newest_ns, arrival_ns
        if not self._least or stamp_ns - self._block_start >= BLOCK_NS:
            self._block_start = stamp_ns
            self._least.append((stamp_ns, difference))
            while stamp_ns - self._least[0][0] > WINDOW_NS:
                self._least.popleft()
            self._fit()
            early_ns = self._line(stamp_ns) - difference
        elif difference < self._least[-1][1]:
            self._least[-1] = (stamp_ns, difference)
        if early_ns > 0:
            self._anchor = (self._anchor[0], self._anchor[1] - early_ns)

    def offset_ns(self, stamp_ns: int) -> int:
        """Return the offset to add to a sensor stamp.

        Raises
        ------
        ValueError
            No packet was observed yet.
        """
        if not self._least:
            raise ValueError("no packet was observed yet")
        return self._line(stamp_ns) - self._delay_ns

    def _judge_earliness(self, early_ns: int, arrival_ns: int) -> None:
        """Count a step forward: a packet earlier than any before, after a time without such news."""
        if (
            early_ns > max(STEP_NS, self._spacing_ns)
            and self._moved_ns is not None
            and arrival_ns - self._moved_ns > SETTLED_NS
        ):
            self._note_step(early_ns)
        self._moved_ns = arrival_ns

    def _note_step(self, step_ns: int) -> None:
        self.steps += 1
        self.last_step_ns = step_ns

    def _line(self, stamp_ns: int) -> int:
        start, offset = self._anchor
        return offset + round(self._drift * (stamp_ns - start))

    def _fit(self) -> None:
        """Fit the line below all points, along the side of their lower hull below the middle."""
        points = list(self._least)
        newest = points[-1][0]
        self._drift = 0.0
        known = points[:-1]  # the newest block is incomplete, so its minimum is not known yet
        if known and known[-1][0] - known[0][0] >= ENOUGH_NS:  # false after a silence
            middle = (known[0][0] + newest) // 2
            hull = _lower_hull(known)
            a, b = next(((a, b) for a, b in pairwise(hull) if b[0] >= middle), hull[-2:])
            self._drift = max(-MAX_DRIFT, min(MAX_DRIFT, (b[1] - a[1]) / (b[0] - a[0])))
        self._anchor = (newest, min(d + round(self._drift * (newest - s)) for s, d in points))


def _slope(points: list[Point], certain: float) -> float | None:
    """Return the slope of the regression line, None where it determines less than that share."""
    x = [(stamp - points[0][0]) * 1e-9 for stamp, _ in points]
    y = [(delay - points[0][1]) * 1e-9 for _, delay in points]
    mean_x, mean_y = sum(x) / len(x), sum(y) / len(y)
    xx = sum((a - mean_x) ** 2 for a in x)
    xy = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True))
    yy = sum((b - mean_y) ** 2 for b in y)
    return xy / xx if xx > 0 and yy > 0 and xy * xy >= certain * xx * yy else None


def _lower_hull(points: list[Point]) -> list[Point]:
    """Return the corners of the lower convex hull of points in order of stamps."""
    hull: list[Point] = []
    for point in points:
        while len(hull) > 1 and not _turns_up(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
    return hull


def _turns_up(a: Point, b: Point, c: Point) -> bool:
    return (b[1] - a[1]) * (c[0] - b[0]) < (c[1] - b[1]) * (b[0] - a[0])
