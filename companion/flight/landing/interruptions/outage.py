"""Outage timer: time during which scans or position have been missing."""

from __future__ import annotations

from companion.flight.landing.situation import MissingInput

SECOND = 1_000_000_000
CALL_NS = 10 * SECOND  # outage before the pilot is called
BACK_NS = SECOND  # time without a gap that ends an outage


class Outage:
    """An outage, from the first missing input until all inputs have been present for a second.

    The missing input may change or return for an instant: to the pilot this is one outage. The time until the
    call restarts when an input is missing that was not missing before, such as late maps after a lost link,
    but not when the same inputs are missing in turn.
    """

    def __init__(self) -> None:
        self._since_ns: int | None = None
        self._present_ns: int | None = None
        self._reported: set[MissingInput] = set()
        self._called_for: MissingInput | None = None

    def on_missing(self, missing: MissingInput, now_ns: int) -> bool:
        """Record a missing input; return whether the pilot has not been warned of it yet."""
        self._present_ns = None
        if missing in self._reported or self._called_for:
            return False
        self._reported.add(missing)
        self._since_ns = now_ns
        return True

    def calls_for(self, missing: MissingInput, now_ns: int) -> bool:
        """Return whether to call the pilot now: once in a long outage."""
        if self._called_for or self._since_ns is None or now_ns - self._since_ns <= CALL_NS:
            return False
        self._called_for = missing
        return True

    def on_present(self, now_ns: int) -> MissingInput | None:
        """Record that nothing is missing; return the input of a call that is back now, else None."""
        if self._since_ns is None:
            return None
        if self._present_ns is None:
            self._present_ns = now_ns
        if now_ns - self._present_ns < BACK_NS:
            return None
        called_for = self._called_for
        self.reset()
        return called_for

    def reset(self) -> None:
        """End the outage: a new order starts from zero."""
        self._since_ns = self._present_ns = None
        self._reported.clear()
        self._called_for = None
