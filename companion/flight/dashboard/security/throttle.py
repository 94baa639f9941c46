"""Throttle of token guessing: growing delay for wrong tokens, by address of the sender."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

FREE = 3  # wrong tokens without a delay, for typing errors
FIRST_S, LONGEST_S = 0.5, 8.0
FORGET_S = 300.0
MOST_WAITING = 4  # tokens of one address that wait at the same time
MOST_ADDRESSES = 1024
MOST_REPEATED = 4  # wrong tokens of one address that are recognised when repeated


class TooManyGuessesError(Exception):
    """Other tokens of the same address must be checked first."""


@dataclass(slots=True)
class _Record:
    """Wrong tokens of one address."""

    last_s: float
    wrong: int = 0
    repeated: OrderedDict[bytes, int] = field(default_factory=OrderedDict)
    waiting: set[bytes] = field(default_factory=set)


class Throttle:
    """Delays for tokens that are not known to be right.

    An address is delayed only for its own wrong tokens. A token sent repeatedly, as by a page left open with
    an old token, delays itself and no other token of its address: the pilot at the same computer enters the
    right one without a wait.

    Parameters
    ----------
    now
        Monotonic clock in seconds.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._records: OrderedDict[str, _Record] = OrderedDict()

    def delay_s(self, address: str, token: bytes) -> float:
        """Return the delay in seconds before a token is checked."""
        record = self._records.get(address)
        if record is None:
            return 0.0
        if self._now() - record.last_s > FORGET_S and not record.waiting:
            self.forget(address)
            return 0.0
        steps = max(record.wrong + len(record.waiting), record.repeated.get(token, 0)) - FREE
        return 0.0 if steps < 0 else float(min(LONGEST_S, FIRST_S * 2 ** min(steps, 10)))

    @contextmanager
    def waiting(self, address: str, token: bytes) -> Iterator[None]:
        """Count a token as waiting; raise `TooManyGuessesError` if it waits already or too many do."""
        record = self._record(address)
        if token in record.waiting or len(record.waiting) >= MOST_WAITING:
            raise TooManyGuessesError
        record.waiting.add(token)
        try:
            yield
        finally:
            record.waiting.discard(token)

    def count_wrong(self, address: str, token: bytes) -> None:
        """Count a wrong token."""
        record = self._record(address)
        record.last_s = self._now()
        if token not in record.repeated:
            record.wrong += 1
        record.repeated[token] = record.repeated.get(token, 0) + 1
        record.repeated.move_to_end(token)
        while len(record.repeated) > MOST_REPEATED:
            record.repeated.popitem(last=False)

    def forget(self, address: str) -> None:
        """Remove the delay of an address."""
        self._records.pop(address, None)

    def _record(self, address: str) -> _Record:
        """Return the record of an address; beyond `MOST_ADDRESSES` the least recently used one is dropped."""
        record = self._records.setdefault(address, _Record(self._now()))
        self._records.move_to_end(address)
        while len(self._records) > MOST_ADDRESSES:
            self._records.popitem(last=False)
        return record
