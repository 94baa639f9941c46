"""Handling of SIGTERM and SIGINT: the first one ends a flight; outside a flight, any one ends the program."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


class Ended(BaseException):
    """Request of a signal to end the program, raised while no flight waits for signals.

    Attributes
    ----------
    code
        Exit code of the program: 128 plus the signal's number.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.code = 128 + number


class Signals:
    """Handlers of both signals, as a context manager.

    Attributes
    ----------
    came
        Whether a signal arrived within `awaited`.
    """

    def __init__(self) -> None:
        self.came = False
        self._awaited = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Signals:
        for number in (signal.SIGTERM, signal.SIGINT):
            self._before[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    @contextmanager
    def awaited(self) -> Iterator[None]:
        """Record signals in `came` instead of raising `Ended`, for a loop that polls it."""
        self._awaited = True
        try:
            yield
        finally:
            self._awaited = False

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if not self._awaited:
            raise Ended(number)
        self.came = True
