"""SIGTERM and SIGINT: the first one ends a flight, one that comes at any other time the program."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


class Ended(BaseException):
    """Raised by a signal while no flight waits for it.

    Attributes
    ----------
    code
        Exit code of a program that ended so: 128 and the signal's number.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.code = 128 + number


class Signals:
    """Handlers of both signals, as a context manager.

    Attributes
    ----------
    came
        Whether a signal came within `awaited`.
    """

    def __init__(self) -> None:
        self.came = False
        self._awaited = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Signals:
        for number in (signal.SIGTERM, signal.SIGINT):
            self._before[number] = signal.signal(number, self._take)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    @contextmanager
    def awaited(self) -> Iterator[None]:
        """Note signals in `came` instead of raising `Ended`, for a loop that looks there at each turn."""
        self._awaited = True
        try:
            yield
        finally:
            self._awaited = False

    def _take(self, number: int, frame: FrameType | None) -> None:
        if not self._awaited:
            raise Ended(number)
        self.came = True
