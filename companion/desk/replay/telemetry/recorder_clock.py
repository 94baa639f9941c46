"""Clock of the computer that recorded a log and the points beside it, which may be set while it records.

A clock without a battery begins in 1970 or at its last shutdown, and GNSS or NTP sets it in flight. Log and
points step together; the autopilot's own time, which goes on, shows where and by how much.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

# Between two messages of the autopilot, the log's time and the autopilot's own go on alike. A time that goes
# back was set; one that goes far ahead, too (a message may come some seconds late).
BACK_NS, FORWARD_NS = 100_000_000, 10_000_000_000
COMPARED = 50  # messages on either side of a step, of which the least late shows its size


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
        """Return the time that the clock of the end would have told."""
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
        """True if the times go on beyond a step that they do not have: another clock told them."""
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
    """Return whether a time is nearer to those after a step than to those before it."""
    return at_ns > step.at_ns + abs(step.step_ns) // 2
