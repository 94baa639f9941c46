"""Event loop on simulated time: whenever it is idle, it asks the simulator to advance.

The program running in it is unchanged: sockets are real, `asyncio.sleep` and time-outs follow the simulated
clock, and nothing waits for a wall clock. Computation in a worker thread takes as much simulated time as its
maker says.
"""

from __future__ import annotations

import asyncio
import selectors
import socket
import struct
import time
from collections.abc import Callable
from concurrent.futures import Executor
from typing import TypeVar, TypeVarTuple, Unpack

from companion.runtime.errors import CompanionError

Args = TypeVarTuple("Args")
Result = TypeVar("Result")

# Offset of half an hour between the companion's clock and the simulator's, since the clocks of two machines
# never agree.
CLOCK_OFFSET_NS = 1_800_000_000_000
ALONE_STEP_NS = 2_500_000


class LockstepLoop(asyncio.SelectorEventLoop):
    """Selector event loop whose `time()` is that of a simulator stepped by `advance`.

    Parameters
    ----------
    advance
        Called when every ready callback has run and no computation is in progress; returns the new simulated
        time in nanoseconds. Data that it sends to sockets must have arrived when it returns.
    computing_s
        Returns the simulated time that a computation takes, from the time that it took by the wall clock.
    """

    def __init__(
        self, advance: Callable[[], int], computing_s: Callable[[float], float] = lambda _: 0.0
    ) -> None:
        self._computing_s = computing_s
        self._simulated_ns = CLOCK_OFFSET_NS
        self._computing = 0
        self._alone = False
        self._advance = advance
        super().__init__(_IdleSelector(self._on_idle))

    def let_go(self) -> None:
        """Stop asking the simulator: from now on time advances by itself, so that all tasks can end.

        Safe in a signal handler, also during a call of `advance`.
        """
        self._alone = True

    def time(self) -> float:
        return self._simulated_ns * 1e-9

    def run_in_executor(
        self, executor: Executor | None, func: Callable[[Unpack[Args]], Result], *args: *Args
    ) -> asyncio.Future[Result]:
        future, begun_s = super().run_in_executor(executor, func, *args), time.perf_counter()
        self._computing += 1
        simulated: asyncio.Future[Result] = self.create_future()

        def on_done(_: object) -> None:
            self._computing -= 1
            took_s = self._computing_s(time.perf_counter() - begun_s)
            if took_s > 0:
                self.call_later(took_s, _complete, future, simulated)
            else:
                _complete(future, simulated)

        future.add_done_callback(on_done)
        simulated.add_done_callback(lambda _: future.cancel())
        return simulated

    def _on_idle(self) -> bool:
        """Advance the simulator; return whether time advanced, which it does not during a computation."""
        if self._computing and not self._alone:
            return False
        self._simulated_ns = self._next_ns()
        return True

    def _next_ns(self) -> int:
        if not self._alone:
            try:
                return CLOCK_OFFSET_NS + self._advance()
            except CompanionError:
                if not self._alone:
                    raise
        return self._simulated_ns + ALONE_STEP_NS


def _complete(future: asyncio.Future[Result], simulated: asyncio.Future[Result]) -> None:
    """Give a future on simulated time the outcome of one that is done."""
    if simulated.cancelled():
        if not future.cancelled():
            future.exception()  # nobody asks for it
    elif future.cancelled():
        simulated.cancel()
    elif (error := future.exception()) is not None:
        simulated.set_exception(error)
    else:
        simulated.set_result(future.result())


class _IdleSelector(selectors.DefaultSelector):
    """Selector that advances the simulated time instead of sleeping."""

    def __init__(self, on_idle: Callable[[], bool]) -> None:
        super().__init__()
        self._on_idle = on_idle

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        events: list[tuple[selectors.SelectorKey, int]] = super().select(0)
        if events or (timeout is not None and timeout <= 0):
            return events
        if self._on_idle():
            return list(super().select(0))
        return list(super().select(0.05))  # a thread computes; its result wakes the selector


class LockstepClient:
    """Client of a simulator in another process: requests of one byte, replies of int64 nanoseconds."""

    def __init__(self, port: int, host: str = "127.0.0.1", timeout_s: float = 60.0) -> None:
        try:
            self._socket = socket.create_connection((host, port), timeout_s)
        except OSError as error:
            raise CompanionError(f"no simulator answers on {host}:{port}: {error}") from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def advance(self) -> int:
        """Advance the simulator by one step and return its time in nanoseconds."""
        try:
            self._socket.sendall(b"\x01")
            answer = b""
            while len(answer) < 8:
                part = self._socket.recv(8 - len(answer))
                if not part:
                    raise CompanionError("the simulator ended")
                answer += part
        except OSError as error:
            raise CompanionError(f"the simulator stopped answering: {error}") from None
        return int(struct.unpack("<q", answer)[0])

    def close(self) -> None:
        self._socket.close()
