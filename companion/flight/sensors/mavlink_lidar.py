"""Range sensors of the autopilot as a substitute for a LiDAR."""

from __future__ import annotations

import asyncio

from companion.flight.link.link import Link
from companion.flight.sensors.diagnosis.lidar_diagnosis import LidarDiagnosis
from companion.flight.sensors.imu_samples import ImuSamples
from companion.flight.sensors.mavlink_ranges import MavlinkRanges
from companion.flight.sensors.packet_stream import Batch, OnReturns
from companion.runtime.event import Event
from params import Parameters


class MavlinkLidar:
    """Receiver of range messages from the link.

    Attributes
    ----------
    batches
        Never emits, because a recording contains the frames.
    on_imu
        Never emits.
    """

    def __init__(self, link: Link, parameters: Parameters, on_returns: OnReturns) -> None:
        self._link = link
        self._ranges = MavlinkRanges(parameters, link.inbox.clock, on_returns)
        self.batches: Event[[Batch]] = Event()
        self.on_imu: Event[[ImuSamples]] = Event()

    @property
    def kind(self) -> str:
        """Name in the sensor URL."""
        return "mavlink"

    @property
    def metadata(self) -> str:
        """Empty: decoding needs no metadata."""
        return ""

    @property
    def stream(self) -> MavlinkLidar:
        """The object with `batches`."""
        return self

    @property
    def last_arrival_ns(self) -> int | None:
        """Arrival of the newest ranges, None before any."""
        return self._ranges.last_arrival_ns

    @property
    def diagnosis(self) -> LidarDiagnosis | None:
        """None: this sensor's stream is not diagnosed."""
        return None

    def statistics(self) -> dict[str, int | float | None]:
        """Return counters of messages and returns, and of dropped data by reason."""
        return self._ranges.statistics()

    async def run(self) -> None:
        """Receive until cancelled."""
        end = self._link.subscribe("*", self._ranges.on_message)
        try:
            await asyncio.get_running_loop().create_future()
        finally:
            end()
