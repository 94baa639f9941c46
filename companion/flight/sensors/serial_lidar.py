"""LiDAR on a serial line."""

from __future__ import annotations

import asyncio

from companion.flight.link.transport.mavlink_url import Url
from companion.flight.link.transport.reconnecting import Transport
from companion.flight.sensors.decoders.lightware_protocol import requests
from companion.flight.sensors.decoders.lightware_stream import LightwareStream
from companion.flight.sensors.diagnosis.lidar_diagnosis import LidarDiagnosis
from companion.runtime.clock import now_ns
from companion.runtime.errors import CompanionError

BATCH_S = 0.01
ASK_S = 2.0
SILENT_NS = 2_000_000_000


class SerialLidar:
    """Driver that opens the line, reopens it after errors, and requests streaming until the sensor streams.

    Attributes
    ----------
    stream
        Decoder of the bytes.
    on_imu
        Never emits.
    """

    def __init__(self, url: Url, stream: LightwareStream) -> None:
        self._transport = Transport(url)
        self.stream = stream
        self.on_imu = stream.on_imu

    @property
    def last_arrival_ns(self) -> int | None:
        """Arrival of the newest reading, None before any."""
        return self.stream.last_arrival_ns

    @property
    def diagnosis(self) -> LidarDiagnosis | None:
        """None: this sensor's stream is not diagnosed."""
        return None

    def statistics(self) -> dict[str, int | float | None]:
        """Return counters of readings and returns, and of dropped data by reason."""
        return self.stream.statistics() | {"opened": self._transport.opened}

    async def run(self) -> None:
        """Receive until cancelled.

        Raises
        ------
        UsageError
            The device cannot be opened.
        """
        failed: BaseException | None = None
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._transport.run(self._add_bytes), name="lidar line")
                group.create_task(self._ask(), name="lidar requests")
                group.create_task(self._flush(), name="lidar batches")
        except* CompanionError as failures:
            failed = failures.exceptions[0]  # if raised here, Python before 3.11.4 would wrap it in a group
        if failed is not None:
            raise failed from None

    def _add_bytes(self, data: bytes) -> None:
        self.stream.add_packet(data, "", now_ns())

    async def _ask(self) -> None:
        while True:
            last_ns = self.last_arrival_ns
            if self._transport.up and (last_ns is None or now_ns() - last_ns > SILENT_NS):
                for request in requests():
                    self._transport.write(request)
            await asyncio.sleep(ASK_S if self._transport.up else BATCH_S)

    async def _flush(self) -> None:
        while True:
            self.stream.flush(now_ns())
            await asyncio.sleep(BATCH_S)
