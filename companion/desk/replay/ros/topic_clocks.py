"""Clocks of a bag's topics; one may be set while the bag is recorded.

The lag of a message is its time of recording less its stamp: a delay, which changes and is made up for. A
clock that is set changes the lags of its topics from one message to the next, and for good.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from companion.desk.replay.recorder_clock import time_of_day
from companion.runtime.errors import UsageError

Times = NDArray[np.int64]
Pair = tuple[int, int]
BELIEVED = 5  # successive messages of another time that make a clock, not bad stamps
STEP_NS = 100_000_000  # smallest step that is found; NTP slews a clock that errs by less than 128 ms
LATE_NS = 1_000_000_000  # messages that overtake each other, or are of several sensors, come less late
COMPARED_NS = 60_000_000_000  # before and after a step: longer than the recorder stalls
APART_NS = 1_000_000_000  # topics of one clock step within this time: their messages have other delays


@dataclass(frozen=True, slots=True)
class _Step:
    """A lasting change of a topic's lag, after the first and before the second of two times of recording."""

    after_ns: int
    before_ns: int
    change_ns: int

    def is_of(self, other: _Step) -> bool:
        """Return True if another topic's step may be of the same clock."""
        apart_ns = max(self.after_ns, other.after_ns) - min(self.before_ns, other.before_ns)
        return apart_ns <= APART_NS and abs(self.change_ns - other.change_ns) <= STEP_NS


def false_stamps(path: Path, times: Mapping[str, Sequence[Pair]]) -> dict[str, set[Pair]]:
    """Return the messages of each topic, by both times, whose stamps contradict those around them.

    Parameters
    ----------
    times
        Time of recording and stamp (ns) of each message of each topic, in the order of recording.

    Raises
    ------
    UsageError
        A clock was set while the bag was recorded: stamps of a topic go back, or its lag changes for good and
        that of another topic does not, so that points would be placed by the poses of another time.
    """
    found: dict[str, set[Pair]] = {}
    steps: dict[str, list[_Step]] = {}
    for topic, pairs in times.items():
        at, stamp = np.array(pairs, np.int64).reshape(-1, 2).T
        kept = ~_few_ahead(at, stamp)
        for run in _runs(
            stamp < np.maximum.accumulate(np.where(kept, stamp, stamp.min(initial=0))) - LATE_NS
        ):
            if len(run) >= BELIEVED and (np.diff(stamp[run]) > 0).all():
                raise _refusal(path, f"stamps on {topic} go back", int(at[run[0]]))
            kept[run] = False
        found[topic] = {pairs[k] for k in np.flatnonzero(~kept).tolist()}
        steps[topic] = _steps(at[kept], stamp[kept])
    for topic, other in permutations(steps, 2):
        for step in steps[topic]:
            if not any(step.is_of(one) for one in steps[other]):
                size = f"{-step.change_ns * 1e-9:+.1f} s"
                what = f"stamps on {topic} step by {size}, and those on {other} do not"
                raise _refusal(path, what, step.after_ns)
    return found


def _refusal(path: Path, what: str, at_ns: int) -> UsageError:
    return UsageError(f"{path}: {what} at {time_of_day(at_ns)}: a clock was set in flight; cut the bag there")


def _few_ahead(at: Times, stamp: Times) -> NDArray[np.bool_]:
    """Return the mask of the few messages far ahead of later ones, or of another time at the beginning."""
    found = np.zeros(len(stamp), bool)
    for run in _runs(stamp > np.minimum.accumulate(stamp[::-1])[::-1] + LATE_NS):
        found[run] = len(run) < BELIEVED
    leaps = np.flatnonzero(np.abs(np.diff(at - stamp)[: BELIEVED - 1]) > 10 * LATE_NS)
    found[: leaps.max(initial=-1) + 1] = True
    return found


def _runs(where: NDArray[np.bool_]) -> list[Times]:
    """Return the indices at which something holds, in runs without gaps."""
    found = np.flatnonzero(where)
    return [run for run in np.split(found, np.flatnonzero(np.diff(found) > 1) + 1) if len(run)]


def _steps(at: Times, stamp: Times) -> list[_Step]:
    """Return the steps of a topic's clock, where its lag changes from one message to the next and for good.

    By more than it varies otherwise: messages that come when they are ready, or with stamps of whole seconds,
    show no small step.
    """
    lag = at - stamp
    found, begin = [], 0
    for k in (np.flatnonzero(np.abs(np.diff(lag)) > STEP_NS) + 1).tolist():
        first, last = np.searchsorted(at, [at[k - 1] - COMPARED_NS, at[k] + COMPARED_NS])
        parts = lag[max(begin, first) : k], lag[k:last]
        if min(len(part) for part in parts) < 2 * BELIEVED:
            continue
        least = [np.partition(part, BELIEVED - 1)[BELIEVED - 1] for part in parts]
        varies_ns = max(np.subtract(*np.percentile(part, (90, 10))) for part in parts)
        if abs(least[1] - least[0]) > STEP_NS + varies_ns:
            found.append(_Step(int(at[k - 1]), int(at[k]), int(least[1] - least[0])))
            begin = k
    return found
