"""Clocks of a bag's topics and of its recorder, which may be set while it records.

Stamps of a topic and times of recording go on alike but for delays: where their difference, the lag, changes
at once and stays, one of the clocks was set. Stamps are counted on the clock of the poses as it was at the
end; a topic agreed with it where their lags are alike.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.replay.ros.ros_pose import BELIEVED
from companion.desk.replay.telemetry.recorder_clock import BACK_NS, COMPARED, FORWARD_NS
from companion.runtime.errors import UsageError

Times = NDArray[np.int64]
MOST_BACK = 3  # a topic stored in more pieces was put together from several bags: their order tells nothing
STEP_NS = 100_000_000  # smallest step that is found; NTP slews a clock that errs by less than 128 ms


class TopicClocks:
    """Mapping of stamps to the clock of the poses at the end.

    Parameters
    ----------
    times
        Topic, time of recording and stamp (ns) of each message, those of a topic in the order of storage.
    poses
        Topics of the poses.

    Attributes
    ----------
    steps
        Topic, last time of recording before, and size (ns) of each step of its stamps, for JSON.

    Raises
    ------
    UsageError
        Messages of before and after a step are mixed up, or it cannot be told when two clocks agreed.
    """

    def __init__(self, times: Iterable[tuple[str, int, int]], poses: Sequence[str]) -> None:
        rows: defaultdict[str, list[tuple[int, int]]] = defaultdict(list)
        for topic, at_ns, stamp_ns in times:
            rows[topic].append((at_ns, stamp_ns))
        told = {topic: np.array(some, np.int64).T for topic, some in rows.items()}
        backs = {topic: np.flatnonzero(np.diff(at) < -BACK_NS) for topic, (at, _) in told.items()}
        backs = {topic: ends[: len(ends) * (len(ends) <= MOST_BACK)] for topic, ends in backs.items()}
        self.steps: list[dict[str, Any]] = []
        self._shifts: dict[str, list[tuple[int, int]]] = {}
        gaps = [np.diff(told[topic][1])[max(0, k - 2) : k + 3] for topic in told for k in backs[topic]]
        if gaps and all(((gap > 0) & (gap < FORWARD_NS)).all() for gap in gaps):
            return  # the recorder's clock alone was set back
        self._told = {topic: _in_order(topic, some, backs[topic]) for topic, some in told.items()}
        at = {topic: some for topic, (some, _) in self._told.items()}
        for topic, (_, stamp) in self._told.items():
            for end, change_ns in _changes(at[topic], stamp, recorder=True):
                set_ns = at[topic][end : end + 2].sum() // 2
                if change_ns > FORWARD_NS or (change_ns > 0 and self._jumps(at, set_ns, change_ns)):
                    at = {name: some - change_ns * (some > set_ns) for name, some in at.items()}
        self._map(at, [topic for topic in poses if topic in at])

    def shift_ns(self, topic: str, at_ns: int) -> int:
        """Return what to add to the stamp of a message recorded at a time."""
        return next((shift_ns for end_ns, shift_ns in self._shifts.get(topic, ()) if at_ns <= end_ns), 0)

    def _jumps(self, at: dict[str, Times], at_ns: int, size_ns: int) -> bool:
        """Return whether stamps of a topic jump by a size with the recorder's clock, about a time."""
        where = (
            (np.diff(stamp), int(np.searchsorted(at[name], at_ns))) for name, (_, stamp) in self._told.items()
        )
        return any((gaps[max(0, k - 2) : k + 2] > size_ns).any() for gaps, k in where)

    def _map(self, at: dict[str, Times], poses: Sequence[str]) -> None:
        """Find the last time of recording of each clock of each topic, and its shift (ns)."""
        clocks = {topic: self._clocks(topic, at[topic]) for topic in at}
        if not poses or not self.steps:
            return
        chief = max(poses, key=lambda topic: len(at[topic]))
        pose_ends, pose_lags = clocks[chief]
        pose_shifts = pose_lags - pose_lags[-1]
        for topic, (ends, lags) in clocks.items():
            own = np.searchsorted(ends, np.arange(len(at[topic])))
            theirs = np.searchsorted(at[chief][pose_ends[:-1]], at[topic])
            pairs, counts = np.unique(np.stack([own, theirs]), axis=1, return_counts=True)
            apart = (lags[pairs[0]] - pose_lags[pairs[1]])[counts >= min(BELIEVED, counts.max())]
            least = 0 if topic == chief else apart[np.argmin(np.abs(apart))]
            others = np.abs(apart[np.abs(apart - least) > STEP_NS])
            if topic != chief and (others < abs(least) + STEP_NS).any():
                raise UsageError(
                    f"a clock of {topic} or {chief} was set in flight, by so little that it cannot be told"
                    " when they agreed: cut the bag there"
                )
            shifts = lags - pose_lags[-1] - least
            near = pose_shifts[np.argmin(np.abs(shifts[:, None] - pose_shifts), axis=1)]
            shifts = np.where(np.abs(near - shifts) <= STEP_NS, near, shifts)  # set together: by the same
            self._shifts[topic] = list(zip(self._told[topic][0, ends].tolist(), shifts.tolist(), strict=True))

    def _clocks(self, topic: str, at: Times) -> tuple[Times, Times]:
        """Return the last message, and the lag (ns), of each clock that a topic's stamps are of."""
        told, stamp = self._told[topic]
        changes = list(_changes(at, stamp))
        ends, sizes_ns = [end for end, _ in changes], [size_ns for _, size_ns in changes]
        self.steps += [{"topic": topic, "at_ns": int(told[end]), "step_ns": -size} for end, size in changes]
        newest_ns = int(np.median((at - stamp)[ends[-1] + 1 if ends else 0 :]))
        return np.array([*ends, len(at) - 1]), newest_ns - np.cumsum([0, *sizes_ns[::-1]])[::-1]


def _in_order(topic: str, told: Times, backs: Times) -> Times:
    """Return times of recording and stamps (2, n) in the order of the former; refuse those that overlap."""
    at = told[0]
    for end in backs + 1:
        if at[end:].max() > at[:end].min():
            raise UsageError(
                f"the recorder's clock was set back by {(at[end - 1] - at[end]) * 1e-9:.1f} s in flight:"
                f" messages of {topic} before and after have the same times; cut the bag there"
            )
    return told[:, np.argsort(at, kind="stable")]


def _changes(at: Times, stamp: Times, recorder: bool = False) -> Iterator[tuple[int, int]]:
    """Yield the last message before each lasting change of the lag, and its size (ns).

    A clock of stamps shows it by stamps that go back, or ahead of the recorder's; the recorder's by times
    that go ahead of the stamps. A few messages with other stamps are no clock, and messages that come less
    late than before may have left a queue.
    """
    lag, gaps, excess = at - stamp, np.diff(stamp), np.diff(stamp - at)
    ahead = gaps > STEP_NS + (np.median(gaps) if len(gaps) else 0)
    was_set = ((excess > STEP_NS) & ahead) | ((excess < -STEP_NS) & (gaps < 0))
    if recorder:
        was_set = (excess < -STEP_NS) & (gaps > 0)
    parts = np.split(np.arange(len(at)), np.flatnonzero(was_set) + 1)
    for before, after in pairwise(part for part in parts if _goes_on(at[part], stamp[part])):
        least = int(lag[after[:COMPARED]].min())
        change = least - int(lag[before[-COMPARED:]].min())
        if -FORWARD_NS < change < 0 <= least:
            continue
        at_once = int(lag[after[0]] - lag[before[-1]])
        if abs(change) > STEP_NS and abs(at_once - change) <= max(STEP_NS, abs(change) // 2):
            yield int(before[-1]), change


def _goes_on(at: Times, stamp: Times) -> bool:
    """Return whether stamps of some messages are of a clock: they advance as the recorder's."""
    if len(at) < BELIEVED:
        return False
    passed_ns, told_ns = int(at[-1] - at[0]), int(stamp[-1] - stamp[0])
    return 2 * abs(told_ns - passed_ns) <= max(2 * STEP_NS, passed_ns)
