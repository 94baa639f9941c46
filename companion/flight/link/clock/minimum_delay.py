"""Clock offset from the message of least delay."""

from __future__ import annotations

BUCKET_NS = 15_000_000_000


class MinimumDelay:
    """Offset from the message of least delay over the last 15 to 30 seconds.

    Converted stamps are late by that least delay. It is the only offset until TIMESYNC is answered.
    """

    def __init__(self) -> None:
        self._begun_ns: int | None = None
        self._current_ns: int | None = None
        self._previous_ns: int | None = None

    def add(self, autopilot_ns: int, now_ns: int) -> int:
        """Add an arrival and return the offset to add to the autopilot's time."""
        if self._begun_ns is None or now_ns - self._begun_ns > BUCKET_NS:
            self._begun_ns, self._previous_ns, self._current_ns = now_ns, self._current_ns, None
        offset = now_ns - autopilot_ns
        self._current_ns = offset if self._current_ns is None else min(self._current_ns, offset)
        return self._current_ns if self._previous_ns is None else min(self._current_ns, self._previous_ns)

    @property
    def offset_ns(self) -> int | None:
        """Offset to add to the autopilot's time, None before the first arrival."""
        known = [offset for offset in (self._current_ns, self._previous_ns) if offset is not None]
        return min(known, default=None)

    def autopilot_ns(self, now_ns: int) -> int | None:
        """Return the approximate time of the autopilot's clock now, None before the first arrival."""
        return None if self._current_ns is None else now_ns - self._current_ns
