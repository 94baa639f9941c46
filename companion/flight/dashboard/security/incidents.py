"""Rate-limited log of unauthorised access to the page."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable

log = logging.getLogger(__name__)

WRONG_TOKEN = "wrong tokens"
UNJUDGED = "tokens refused unread, for others of the address wait"
CROWDED_OUT = "connections ended to make room for others"
LINE_S = 10.0  # interval between two lines of one kind
MOST_ADDRESSES = 64  # counted individually; others are counted together
MOST_NAMED = 3  # addresses per line
OTHERS = "others"


class Incidents:
    """Counts by kind and address, logged as one line per kind every ten seconds.

    Parameters
    ----------
    now
        Monotonic clock in seconds.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._counts: dict[str, Counter[str]] = {}
        self._line_s: dict[str, float] = {}

    def count(self, kind: str, address: str) -> None:
        """Count one incident."""
        counts = self._counts.setdefault(kind, Counter())
        counts[address if address in counts or len(counts) < MOST_ADDRESSES else OTHERS] += 1

    def report(self) -> None:
        """Log the counts that are due."""
        now_s = self._now()
        due = [kind for kind in self._counts if now_s - self._line_s.get(kind, -LINE_S) >= LINE_S]
        for kind in due:
            counts = self._counts.pop(kind)
            self._line_s[kind] = now_s
            log.warning("page: %d %s: %s", counts.total(), kind, _named(counts))


def _named(counts: Counter[str]) -> str:
    """Return `30 from 192.168.1.7, 2 from 192.168.1.9 and 4 more addresses`."""
    text = ", ".join(f"{count} from {address}" for address, count in counts.most_common(MOST_NAMED))
    left = len(counts) - MOST_NAMED
    return f"{text} and {left} more addresses" if left > 0 else text
