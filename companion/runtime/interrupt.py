"""Handling of SIGINT and SIGTERM: the current work ends, leaves no partial files and reports in one line."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType

GRACE_S = 1.5  # a thread that compiles or draws cannot be interrupted; it is abandoned after this
_NAMES = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}


class Interrupted(BaseException):
    """Request of a signal to end the program; no `Exception`, so that no `except Exception` delays it."""

    def __init__(self, number: int) -> None:
        super().__init__(_NAMES[signal.Signals(number)])
        self.exit_code = 128 + number


class Interrupts:
    """Signal handlers; the first signal raises `Interrupted` in the main thread or calls a given action.

    Further signals change nothing. `leftovers` are removed if the program does not end within `GRACE_S`.
    """

    def __init__(self) -> None:
        self.number: int | None = None
        self.leftovers: list[Callable[[], object]] = []
        self._action: Callable[[], None] | None = None
        self._said = threading.Lock()

    @contextlib.contextmanager
    def installed(self) -> Iterator[None]:
        """Install the handlers, in the main thread only; restore the previous ones at the end."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = {number: signal.signal(number, self._on_signal) for number in _NAMES}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    @contextlib.contextmanager
    def handled_by(self, action: Callable[[], None]) -> Iterator[None]:
        """Call `action` instead of raising; `Interrupted` is raised at the end of the block."""
        self._action = action
        try:
            yield
        finally:
            self._action = None
            self.check()

    def held(self) -> contextlib.AbstractContextManager[None]:
        """Defer `Interrupted` to the end of the block."""
        return self.handled_by(lambda: None)

    def check(self) -> None:
        """Raise `Interrupted` if a signal has arrived."""
        if self.number is not None:
            raise Interrupted(self.number)

    def report(self) -> None:
        """Report once, on stderr, which signal ended the program."""
        if self.number is not None and self._said.acquire(blocking=False):
            print(f"slz: {_NAMES[signal.Signals(self.number)]}", file=sys.stderr, flush=True)

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        if self.number is not None:
            return
        self.number = number
        last = threading.Timer(GRACE_S, self._leave)
        last.daemon = True
        last.start()
        if self._action is None:
            raise Interrupted(number)
        self._action()

    def _leave(self) -> None:
        for remove in reversed(self.leftovers):
            with contextlib.suppress(Exception):
                remove()
        self.report()
        os._exit(128 + (self.number or 0))
