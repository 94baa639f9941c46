"""The executive's loop: 20 times a second from what is known to commands, and their execution."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable

from companion.flight.command_execution import CommandExecution
from companion.flight.flight_view import FlightView
from companion.flight.flown_path import FlownPath
from companion.flight.landing.restart import Restart
from companion.flight.map_frame import begin_frame_if_far
from companion.flight.scan_feed import ScanFeed
from companion.flight.situation_source import SituationSource

STEP_S = 0.05


class DecisionLoop:
    """Steps the executive of a flight.

    Parameters
    ----------
    on_new_frame
        Called after another map frame has begun.
    """

    def __init__(
        self,
        flight: FlightView,
        feed: ScanFeed,
        situations: SituationSource,
        execution: CommandExecution,
        restart: Restart,
        path: FlownPath,
        on_new_frame: Callable[[], None],
    ) -> None:
        self._flight, self._feed, self._situations = flight, feed, situations
        self._execution, self._restart, self._path = execution, restart, path
        self._on_new_frame = on_new_frame
        self._hurry = asyncio.Event()

    async def run(self, stop: asyncio.Event) -> None:
        """Step until stopped: the last setpoint is that of whoever stops it."""
        loop = asyncio.get_running_loop()
        next_s = loop.time()
        while not stop.is_set():
            self.run_once()
            next_s = max(next_s + STEP_S, loop.time())
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout_at(next_s):
                    await self._hurry.wait()
                    next_s = loop.time()  # the step after this one is due a whole step from now
            self._hurry.clear()

    def hurry(self) -> None:
        """Take the next step now."""
        self._hurry.set()

    def run_once(self) -> None:
        """Step the executive once and carry out its commands."""
        flight = self._flight
        self._feed.follow_jumps()  # before the executive selects the point again, in the new map
        self._feed.warn_of_attitudes()
        if begin_frame_if_far(flight):
            self._feed.begin_frame()
            self._on_new_frame()
        self._situations.blocked = self._execution.blocked
        self._situations.blocked_above = self._execution.blocked_above
        self._situations.asked_enu_ms = self._execution.sent_enu_ms
        situation, vehicle = self._situations.situation(), flight.link.vehicle
        commands = flight.executive.step(situation)
        self._restart.update(
            situation, flight.executive, flight.history.frame, vehicle.sysid, vehicle.boot_ms
        )
        self._execution.execute(commands, situation)
        self._path.follow(situation, heard_ever=vehicle.sysid is not None)
