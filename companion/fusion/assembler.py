"""Holds returns back until poses bracket them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from companion.fusion.georeference import Georeferencer
from companion.fusion.pose_history import PoseHistory
from companion.sensors.returns import Returns
from params import Parameters
from slz import Scan

SCAN_NS = 50_000_000
MOST_WAITING = 400


class ScanAssembler:
    """Turns batches of returns into scans of about 50 ms, never placing one with a stale pose.

    Returns wait until attitude and position of a later time are known, at most `pose_timeout_s`; then they
    are dropped and counted. Memory is bounded: the oldest batch goes first.
    """

    def __init__(self, parameters: Parameters, history: PoseHistory, on_scan: Callable[[Scan], None]) -> None:
        self._history = history
        self._on_scan = on_scan
        self._georeferencer = Georeferencer(parameters)
        self._timeout_ns = round(parameters.pose_timeout_s * 1e9)
        self._waiting: deque[Returns] = deque()
        self._scan: list[Returns] = []
        self._jumps = 0
        self.timed_out = 0

    def add(self, returns: Returns) -> None:
        """Take a batch, and emit every scan that is complete."""
        self._waiting.append(returns)
        self._expire(int(returns.stamp_ns[-1]))
        covered = self._history.bracketed_until_ns
        if self._history.jumps != self._jumps:
            self._jumps = self._history.jumps
            self._scan.clear()  # a scan must not straddle a reset of the estimate
        while covered is not None and self._waiting and int(self._waiting[0].stamp_ns[-1]) <= covered:
            self._gather(self._waiting.popleft())

    def _gather(self, returns: Returns) -> None:
        self._scan.append(returns)
        first = int(self._scan[0].stamp_ns[0])
        if int(returns.stamp_ns[-1]) - first < SCAN_NS:
            return
        batch, self._scan = self._scan, []
        joined = Returns(
            np.concatenate([r.xyz_sensor_m for r in batch]),
            np.concatenate([r.stamp_ns for r in batch]),
            np.concatenate([r.intensity for r in batch]),
        )
        scan = self._georeferencer.georeference(joined, self._history)
        if scan is not None:
            self._on_scan(scan)

    def _expire(self, newest_ns: int) -> None:
        while self._waiting and (
            newest_ns - int(self._waiting[0].stamp_ns[-1]) > self._timeout_ns
            or len(self._waiting) > MOST_WAITING
        ):
            self.timed_out += len(self._waiting.popleft())

    def statistics(self) -> dict[str, int]:
        """Counters of what was not placed."""
        return {
            "without_pose": self._georeferencer.without_pose + self.timed_out,
            "out_of_range": self._georeferencer.out_of_range,
        }
