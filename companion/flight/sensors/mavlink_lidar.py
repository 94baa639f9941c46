"""The autopilot's own range sensors in place of a LiDAR."""

from __future__ import annotations

import asyncio

from companion.flight.link.link import Link
from companion.flight.sensors.mavlink_ranges import MavlinkRanges
from companion.flight.sensors.packet_stream import Batch, OnReturns
from companion.runtime.event import Event
from params import Parameters


class MavlinkLidar:
    """Takes range messages off the link.

    Attributes
    ----------
    batches
        Never emits: a recording has the frames.
    """

    def __init__(self, link: Link, parameters: Parameters, on_returns: OnReturns) -> None:
        self._link = link
        self._ranges = MavlinkRanges(parameters, link.clock, on_returns)
        self.batches: Event[[Batch]] = Event()

    @property
    def kind(self) -> str:
        """As in the URL."""
        return "mavlink"

    @property
    def setup(self) -> str:
        """Its data tell all."""
        return ""

    @property
    def stream(self) -> MavlinkLidar:
        """What `batches` belong to."""
        return self

    @property
    def last_arrival_ns(self) -> int | None:
        """Arrival of the newest ranges, None before any."""
        return self._ranges.last_arrival_ns

    def statistics(self) -> dict[str, int | float | None]:
        """Return counters of messages and returns, and of what was dropped and why."""
        return self._ranges.statistics()

    async def run(self) -> None:
        """Listen until cancelled."""
        end = self._link.subscribe("*", self._ranges.take)
        try:
            await asyncio.get_running_loop().create_future()
        finally:
            end()
