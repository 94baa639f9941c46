"""How long what the vehicle flies by, scans and position, has been missing."""

from __future__ import annotations

SECOND = 1_000_000_000
CALL_NS = 10 * SECOND  # missing before the pilot is called
BACK_NS = SECOND  # there without a gap before an outage is over


class Outage:
    """Lasts from the first thing that is missing to the moment when all has been there for a second.

    What is missing may change on the way, and come back for an instant: to the pilot it is one outage. The
    time to the call begins anew where something is missing that was not before, as late maps after a lost
    link are, and not where the same things are missing in turn.
    """

    def __init__(self) -> None:
        self._since_ns: int | None = None
        self._there_ns: int | None = None
        self._told: set[str] = set()
        self._called_for = ""

    def missing(self, what: str, now_ns: int) -> bool:
        """Note that something is missing now; tell whether the pilot has not been told of it yet."""
        self._there_ns = None
        if what in self._told or self._called_for:
            return False
        self._told.add(what)
        self._since_ns = now_ns
        return True

    def calls_for(self, thing: str, now_ns: int) -> bool:
        """Tell whether the pilot is to be called now: once in an outage, when it has lasted long."""
        if self._called_for or self._since_ns is None or now_ns - self._since_ns <= CALL_NS:
            return False
        self._called_for = thing
        return True

    def there(self, now_ns: int) -> str:
        """Note that nothing is missing now; return what the pilot was called for when it is back, else ""."""
        if self._since_ns is None:
            return ""
        if self._there_ns is None:
            self._there_ns = now_ns
        if now_ns - self._there_ns < BACK_NS:
            return ""
        called_for = self._called_for
        self.over()
        return called_for

    def over(self) -> None:
        """Forget it: a new order counts anew."""
        self._since_ns = self._there_ns = None
        self._told.clear()
        self._called_for = ""
