"""Stopwatch of the pipeline's stages."""

from __future__ import annotations

import time


class StageClock:
    """Measures how long each stage takes.

    Attributes
    ----------
    ms
        Milliseconds by stage, in their order.
    """

    def __init__(self) -> None:
        self.ms: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Give the time since the last lap to a stage."""
        now = time.perf_counter()
        self.ms[stage] = (now - self._last) * 1e3
        self._last = now
