"""Clocks of a bag's topics, of which one may be set while the bag is recorded.

The lag of a message is its time of recording less its stamp: a delay, which changes and is made up for. A
clock that is set changes the lags of its topics from one message to the next, and for good.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from companion.desk.replay.time_of_day import time_of_day
from companion.runtime.errors import UsageError

Times = NDArray[np.int64]
Told = tuple[int, int]
BELIEVED = 5  # so many messages in succession are another clock, and no bad stamps
COMPARED = 50  # messages on either side of a step, of which the least late tells its size
UNSURE = 10  # error of the least delay of n messages: so many n-th parts of its distance to their median
STEP_NS = 100_000_000  # smallest step that is found; NTP slews a clock that errs by less than 128 ms
LATEST_NS = 10_000_000_000  # a message may come some seconds late
APART_NS = 1_000_000_000  # topics of one clock step within this time: their messages have other delays


@dataclass(frozen=True, slots=True)
class _Step:
    """A lasting change of a topic's lag, after the first and before the second of two times of recording."""

    after_ns: int
    before_ns: int
    change_ns: int

    def is_of(self, other: _Step) -> bool:
        """Return whether another topic's step may be of the same clock."""
        apart_ns = max(self.after_ns, other.after_ns) - min(self.before_ns, other.before_ns)
        return apart_ns <= APART_NS and abs(self.change_ns - other.change_ns) <= STEP_NS


def false_stamps(path: Path, times: Mapping[str, Sequence[Told]]) -> dict[str, set[Told]]:
    """Return those messages of each topic whose stamps contradict those before and after.

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
    found: dict[str, set[Told]] = {}
    steps: dict[str, list[_Step]] = {}
    told = {topic: np.array(pairs, np.int64).reshape(-1, 2).T for topic, pairs in times.items()}
    every = np.sort(np.concatenate([at for at, _ in told.values()]))
    mixed = np.logical_and.reduce([_twice_as_many(at, stamp, every) for at, stamp in told.values()])
    if mixed.any():
        what = "messages of before and after have the same times"
        raise _refusal(path, what, int(every[np.argmax(mixed)]))
    for topic, (at, stamp) in told.items():
        found[topic] = set()
        if len(at) < BELIEVED:
            continue
        kept = _rising(stamp)
        gone = np.flatnonzero(~kept)
        for run in np.split(gone, np.flatnonzero(np.diff(gone) > 1) + 1):
            if _rising(stamp[run]).sum() >= BELIEVED:
                raise _refusal(path, f"stamps on {topic} go back", int(at[run[0]]))
        steps[topic] = _steps(at, stamp, kept, every)
        found[topic] = {times[topic][k] for k in np.flatnonzero(~kept).tolist()}
    for topic, other in permutations(steps, 2):
        for step in steps[topic]:
            if not any(step.is_of(one) for one in steps[other]):
                size = f"{-step.change_ns * 1e-9:+.1f} s"
                what = f"stamps on {topic} step by {size}, and those on {other} do not"
                raise _refusal(path, what, step.after_ns)
    return found


def _refusal(path: Path, what: str, at_ns: int) -> UsageError:
    return UsageError(f"{path}: {what} at {time_of_day(at_ns)}: a clock was set in flight; cut the bag there")


def _rising(stamp: Times) -> NDArray[np.bool_]:
    """Return which stamps are the most that never go back."""
    if (np.diff(stamp) >= 0).all():
        return np.ones(len(stamp), bool)
    lasts: list[int] = []  # least last stamp of so many that rise
    ends: list[int] = []  # its index
    before: list[int] = []
    for k, stamp_ns in enumerate(stamp.tolist()):
        length = bisect_right(lasts, stamp_ns)
        lasts[length : length + 1] = [stamp_ns]
        ends[length : length + 1] = [k]
        before.append(ends[length - 1] if length else -1)
    kept, k = np.zeros(len(stamp), bool), ends[-1]
    while k >= 0:
        kept[k] = True
        k = before[k]
    return kept


def _twice_as_many(at: Times, stamp: Times, every: Times) -> NDArray[np.bool_]:
    """Return at which of all times a topic's stamps are twice as many as usual, of two times in one."""
    if len(at) < 2 * BELIEVED:
        return np.zeros(len(every), bool)
    pairs = stamp[2:] - stamp[:-2] <= 1.1 * np.median(np.diff(stamp))
    dense = np.convolve(np.convolve(pairs, np.ones(BELIEVED), "valid") == BELIEVED, np.ones(BELIEVED)) > 0
    return dense[np.clip(np.searchsorted(at, every) - 1, 0, len(dense) - 1)]


def _steps(at: Times, stamp: Times, kept: NDArray[np.bool_], every: Times) -> list[_Step]:
    """Return the steps of a topic's clock among the messages kept; keep no few messages of another clock.

    A queue changes the lag, too, but its stamps go on as before, and messages of other topics come meanwhile.
    """
    lag = at - stamp
    for part in (some for some in _parts(at, stamp, kept, every) if len(some) < BELIEVED):
        rows = np.flatnonzero(kept)
        begin, end = np.searchsorted(rows, [part[0], part[-1] + 1])
        around = lag[np.concatenate([rows[max(0, begin - COMPARED) : begin], rows[end : end + COMPARED]])]
        if len(around):
            most_late_ns = LATEST_NS if begin and end < len(rows) else STEP_NS
            late = lag[part] - around.min()
            kept[part] = (late >= -STEP_NS) & (late <= most_late_ns)
    rows = np.flatnonzero(kept)
    found, begin = [], 0
    for part in _parts(at, stamp, kept, every)[1:]:
        k = int(np.searchsorted(rows, part[0]))
        before, after = lag[rows[max(begin, k - COMPARED) : k]], lag[rows[k : k + COMPARED]]
        change_ns = int(after.min() - before.min())
        spread_ns = max(np.median(some) - some.min() for some in (before, after))
        if abs(change_ns) > STEP_NS + UNSURE * spread_ns / min(len(before), len(after)):
            found.append(_Step(int(at[rows[k - 1]]), int(at[rows[k]]), change_ns))
            begin = k
    return found


def _parts(at: Times, stamp: Times, kept: NDArray[np.bool_], every: Times) -> list[Times]:
    """Return the indices of the messages kept, split where a clock may have been set: where lags change.

    But not where stamps go on as usual and messages of other topics come meanwhile: that is a queue.
    """
    rows = np.flatnonzero(kept)
    gaps, changes = np.diff(stamp[rows]), np.abs(np.diff((at - stamp)[rows]))
    usual = np.abs(gaps - np.median(gaps)) <= min(STEP_NS, np.median(gaps) / 2) if len(gaps) else gaps < 0
    ends = np.flatnonzero(changes > STEP_NS)
    silence = np.diff(every)
    queued = [
        usual[k]
        and rows[k + 1] - rows[k] == 1
        and silence[slice(*np.searchsorted(every, at[rows[k : k + 2]]))].max(initial=0) < changes[k] - STEP_NS
        for k in ends
    ]
    return np.split(rows, ends[~np.array(queued, bool)] + 1)
