"""Progress and remaining time of a survey."""

from __future__ import annotations

import time
from collections.abc import Callable

SOON_S = 5.0  # no remaining time is reported before this

Tell = Callable[[str, float], None]


class Progress:
    """Reporter of the current step, the completed share and the remaining time.

    Every step has a share of the whole; work done by an earlier run does not count for the remaining time.
    """

    def __init__(self, tell: Tell, clock: Callable[[], float] = time.monotonic) -> None:
        self._tell = tell
        self._clock = clock
        self._began = clock()
        self._from = self._to = self._resumed = 0.0
        self._what = ""
        self._total = 1

    def begin_stage(self, what: str, share: float, total: int, done: int = 0) -> None:
        """Begin a step of `total` tasks; an earlier run completed `done` of them."""
        self._from, self._to = self._to, min(1.0, self._to + share)
        self._what, self._total = what, max(1, total)
        self._resumed += (self._to - self._from) * done / self._total
        self.report(0)

    def report(self, count: int) -> None:
        """Report that `count` tasks of the step are done."""
        share = self._from + (self._to - self._from) * min(1.0, count / self._total)
        passed = self._clock() - self._began
        own = share - self._resumed
        left = ""
        if passed > SOON_S and own > 0.02 and share < 1:
            left = f", {_words(passed * (1 - share) / own)} left"
        self._tell(f"{self._what}{left}", share)


def _words(seconds: float) -> str:
    """Return a duration with its unit."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h" if seconds < 172_800 else f"{seconds / 86400:.1f} days"
