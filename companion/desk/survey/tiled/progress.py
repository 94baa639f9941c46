"""How far a survey is, and when it will be done."""

from __future__ import annotations

import time
from collections.abc import Callable

SOON_S = 5.0  # before so much has passed no time left is told

Tell = Callable[[str, float], None]


class Progress:
    """Tells what is being done, the share that is done and the time left.

    Steps have shares of the whole; what an earlier run had done does not count for the time left.
    """

    def __init__(self, tell: Tell, clock: Callable[[], float] = time.monotonic) -> None:
        self._tell = tell
        self._clock = clock
        self._began = clock()
        self._from = self._to = self._resumed = 0.0
        self._what = ""
        self._total = 1

    def step(self, what: str, share: float, total: int, done: int = 0) -> None:
        """Begin a step of so many tasks, some of which were done in an earlier run."""
        self._from, self._to = self._to, min(1.0, self._to + share)
        self._what, self._total = what, max(1, total)
        self._resumed += (self._to - self._from) * done / self._total
        self.at(0)

    def at(self, count: int) -> None:
        """Tell that so many tasks of the step are done."""
        share = self._from + (self._to - self._from) * min(1.0, count / self._total)
        passed = self._clock() - self._began
        own = share - self._resumed
        left = ""
        if passed > SOON_S and own > 0.02 and share < 1:
            left = f", {_words(passed * (1 - share) / own)} left"
        self._tell(f"{self._what}{left}", share)


def _words(seconds: float) -> str:
    """Return a time in two figures."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 5400:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h" if seconds < 172_800 else f"{seconds / 86400:.1f} days"
