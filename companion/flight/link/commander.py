"""Sender of commands to the autopilot that waits for their results."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Callable
from typing import Any

from companion.flight.link.command import Command, CommandCall, CommandResult
from companion.runtime.clock import now_ns


class Commander:
    """Commands in progress, one per command number, because acknowledgements carry only that number.

    A command that ended before its answer came (superseded or cancelled) still has one outstanding. Until its
    deadline, the first answer is assigned to it and not to the next command of its number.

    Parameters
    ----------
    send
        Called with a command and the number of the try; returns False if there is no vehicle to send it to.
    """

    def __init__(self, send: Callable[[Command, int], bool]) -> None:
        self._send = send
        self._calls: dict[int, tuple[CommandCall, asyncio.Event]] = {}
        self._owed_until_ns: dict[int, int] = {}
        self._locks: defaultdict[int, asyncio.Lock] = defaultdict(asyncio.Lock)

    async def run(
        self, command: Command, *, timeout_s: float, tries: int, supersede: bool = False
    ) -> CommandResult:
        """Send a command until it is answered; wait for an earlier one of its number, or supersede it."""
        if supersede and (running := self._calls.get(command.command)):
            running[0].supersede()
            running[1].set()
        async with self._locks[command.command]:
            call, wake = CommandCall(command, round(timeout_s * 1e9), tries), asyncio.Event()
            self._calls[command.command] = call, wake
            try:
                return await self._finish(call, wake)
            finally:
                del self._calls[command.command]
                if call.unanswered and call.deadline_ns is not None:
                    self._owed_until_ns[command.command] = call.deadline_ns

    def acknowledge(self, message: Any, at_ns: int) -> None:
        """Process a COMMAND_ACK addressed to us."""
        if at_ns < self._owed_until_ns.pop(message.command, 0):
            return
        if running := self._calls.get(message.command):
            running[0].acknowledge(message, at_ns)
            running[1].set()

    async def _finish(self, call: CommandCall, wake: asyncio.Event) -> CommandResult:
        while call.result is None:
            attempt = call.poll(now_ns())
            if attempt is not None and not self._send(call.command, attempt):
                return CommandResult(call.command.command, "not_connected", attempt)
            if call.result is not None or call.deadline_ns is None:
                break
            wake.clear()
            try:
                # One microsecond more, because rounding could otherwise let the loop run without time
                # passing.
                async with asyncio.timeout_at(call.deadline_ns * 1e-9 + 1e-6):
                    await wake.wait()
            except TimeoutError:
                continue
        assert call.result is not None  # noqa: S101 - the loop's condition
        return call.result
