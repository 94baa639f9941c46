"""Watch over messages of the autopilot that come seconds late, or once more."""

from __future__ import annotations

MANY, WITHIN_NS = 20, 10_000_000_000


class OldMessageWatch:
    """Decides when to tell the pilot that the link delivers old messages: once, when they are many."""

    def __init__(self) -> None:
        self._begun_ns: int | None = None
        self._count = 0
        self._told = False

    def is_news(self, count: int, now_ns: int) -> bool:
        """Return whether to tell now; `count`: old messages since the start, none of which was used."""
        if self._begun_ns is None or now_ns - self._begun_ns > WITHIN_NS:
            self._begun_ns, self._count = now_ns, count
        if self._told or count - self._count < MANY:
            return False
        self._told = True
        return True
