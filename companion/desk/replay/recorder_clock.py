"""Clock of the computer that recorded a log and the points beside it, which may be set while it records.

A clock without a battery begins in 1970 or at its last shutdown, and GNSS or NTP sets it in flight. Log and
points step together; the autopilot's own time, which continues, shows where and by how much.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

# Between two messages of the autopilot, the log's time and the autopilot's own advance equally. A log's time
# that jumps back or far ahead was set; a message that comes late lags by some seconds only.
BACK_NS, FORWARD_NS = 100_000_000, 10_000_000_000
COMPARED = 50  # messages on either side of a step; the least delayed one shows its size

EARLIEST_NS = 10**18  # September 2001; smaller times have another epoch

HOUR_S, DAY_S, WEEK_S = 3600, 86_400, 604_800
# Usual differences of clocks, the most specific first: size, name, and most multiples.
USUAL = (
    (1024 * WEEK_S, "1024 weeks (a receiver whose count of weeks overflowed)", 3),
    (315_964_800, "the epoch of GPS (1980 for 1970)", 1),
    (1_000_000_000, "1e9 s (that standard GPS time of LAS leaves out)", 1),
    (WEEK_S, "weeks", 5000),
    (DAY_S, "days", 20_000),
    (HOUR_S, "hours (a time zone)", 14),
    (HOUR_S // 4, "quarters of an hour (a time zone)", 56),
)
LEAPS_S = (18, -18, 37, -37, 17, -17, 19, -19)  # GPS and TAI time minus UTC, today's first
SLACK_S = 0.5


@dataclass(frozen=True, slots=True)
class ClockStep:
    """A step of a clock. at_ns: last time before it. step_ns: its size, positive forward."""

    at_ns: int
    step_ns: int


class RecorderClock:
    """Finder of steps of the recorder's clock."""

    def __init__(self) -> None:
        self._times: list[tuple[int, int]] = []  # of the log, and since the autopilot's start (ns)

    def note(self, message: Any, at_ns: int) -> None:
        """Note a message of the autopilot, in the order of the log."""
        boot_ms = getattr(message, "time_boot_ms", None)
        if boot_ms is not None:
            self._times.append((at_ns, boot_ms * 1_000_000))

    def steps(self) -> tuple[ClockStep, ...]:
        """Return the steps up to now."""
        if not self._times:
            return ()
        at_ns, boot_ns = np.array(self._times, np.int64).T
        gaps_ns, passed_ns = np.diff(at_ns), np.diff(boot_ns)
        was_set = (gaps_ns < -BACK_NS) | (gaps_ns - passed_ns > FORWARD_NS)
        ends = np.flatnonzero(was_set & (passed_ns > 0)) + 1
        parts = np.split(at_ns - boot_ns, ends)
        return tuple(
            ClockStep(int(at_ns[end - 1]), int(after[:COMPARED].min() - before[-COMPARED:].min()))
            for end, before, after in zip(ends, parts[:-1], parts[1:], strict=True)
        )


class ContinuousTime:
    """Times of a file by the recorder's clock as it was at the end, in the order of the file.

    A step belongs between two times whose distance is nearer to its size than to nothing.
    """

    def __init__(self, steps: Sequence[ClockStep]) -> None:
        self._steps = tuple(steps)
        self._done = 0
        self._last_ns: int | None = None

    def __call__(self, at_ns: int) -> int:
        """Return the time by the clock as it was at the end."""
        if self._last_ns is None:
            self._done = sum(_is_after(at_ns, step) for step in self._steps)
        else:
            gap_ns = at_ns - self._last_ns
            for k, step in enumerate(self._steps[self._done :], self._done + 1):
                if abs(gap_ns - step.step_ns) < abs(gap_ns):
                    self._done = k
                    break
        self._last_ns = at_ns
        return at_ns + sum(step.step_ns for step in self._steps[self._done :])

    @property
    def lacks_step(self) -> bool:
        """True if the times continue beyond a step that they lack: they are of another clock."""
        if self._last_ns is None or self._done == len(self._steps):
            return False
        return _is_after(self._last_ns, self._steps[self._done])


def continuous_time(steps: Sequence[ClockStep], times_ns: Iterable[int]) -> ContinuousTime:
    """Return the times of a file whose clock may have been set with the recorder's, from all its times."""
    tried = ContinuousTime(steps)
    if steps:
        for at_ns in times_ns:
            tried(at_ns)
    return ContinuousTime(() if tried.lacks_step else steps)


def _is_after(at_ns: int, step: ClockStep) -> bool:
    """Return True if a time is nearer to the times after a step than to the times before it."""
    return at_ns > step.at_ns + abs(step.step_ns) // 2


def time_of_day(at_ns: int) -> str:
    """Return a time of day (UTC), or seconds for times of another epoch."""
    if at_ns < EARLIEST_NS:
        return f"{at_ns * 1e-9:.3f} s"
    return time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(at_ns // 1_000_000_000))


def fitting_offset(points_ns: tuple[int, int], log_ns: tuple[int, int]) -> str:
    """Return the offset that would put points, measured from and to a time, into a log's span.

    Usual differences of clocks are named: weeks, days, time zones, epochs, leap seconds.
    """
    low_s, high_s = sorted((log - point) * 1e-9 for log, point in zip(log_ns, points_ns, strict=True))
    low_s, high_s = low_s - SLACK_S, high_s + SLACK_S
    middle_s = (low_s + high_s) / 2
    for leap_s in (0, *LEAPS_S):
        for size_s, name, most in USUAL:
            times = round((middle_s - leap_s) / size_s)
            if 0 < abs(times) <= most and low_s <= times * size_s + leap_s <= high_s:
                count = f"{times:+d} x" if most == 1 or size_s == USUAL[0][0] else f"{times:+d}"
                leaps = f" and {leap_s:+d} s (leap seconds)" if leap_s else ""
                return f"an offset of {count} {name}{leaps} would fit"
        if leap_s and low_s <= leap_s <= high_s and high_s - low_s < abs(leap_s) + 2 * SLACK_S:
            return f"an offset of {leap_s:+d} s (leap seconds) would fit"
    return f"an offset of {middle_s:+.1f} s would fit"
