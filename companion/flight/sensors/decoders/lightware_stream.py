"""Time-stamped batches of returns from a LightWare sensor's byte stream; without I/O.

The sensor sends no time, but its readings are equally spaced. The readings of one read are stamped backwards
from its arrival at the rate of the last second, or closer together if they would otherwise overlap the
previous read.
"""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from companion.flight.sensors.decoders.lightware_protocol import LightwareDecoder
from companion.flight.sensors.imu_samples import ImuSamples
from companion.flight.sensors.packet_stream import Batch, OnReturns
from companion.flight.sensors.returns import Returns
from companion.runtime.event import Event
from params import Parameters

LONGEST_NS = 20_000_000  # longest period, at 50 readings a second
SPAN_NS = 1_000_000_000


class LightwareStream:
    """Decoder and time stamper of readings; same interface as `PacketStream`.

    Attributes
    ----------
    batches
        Event of the bytes of a batch, before they are decoded.
    on_imu
        Never emits: the sensor has no inertial measurement unit.
    last_arrival_ns
        Arrival of the newest reading; None before any.
    """

    def __init__(self, parameters: Parameters, on_returns: OnReturns) -> None:
        self._decoder = LightwareDecoder()
        self._on_returns = on_returns
        self._delay_ns = round(parameters.lidar_delay_ms * 1e6)
        self._kept: Batch = []
        self._begun_ns: int | None = None
        self._last_ns: int | None = None
        self._count = 0
        self._period_ns = LONGEST_NS
        self._rate_hz = 0.0
        self.batches: Event[[Batch]] = Event()
        self.on_imu: Event[[ImuSamples]] = Event()
        self.last_arrival_ns: int | None = None

    @property
    def kind(self) -> str:
        """Name in the sensor URL."""
        return "lightware"

    @property
    def metadata(self) -> str:
        """Empty: decoding needs no metadata."""
        return ""

    def __len__(self) -> int:
        """Return the number of chunks waiting to be decoded."""
        return len(self._kept)

    def add_packet(self, data: bytes, host: str, arrival_ns: int) -> None:
        """Store a chunk of the byte stream for the next batch."""
        self._kept.append((arrival_ns, data))

    def flush(self, now_ns: int) -> None:
        """Decode the stored bytes and pass the returns on."""
        if not self._kept:
            return
        kept, self._kept = self._kept, []
        self.batches.emit(kept)
        points: list[NDArray[np.float32]] = []
        stamps: list[NDArray[np.int64]] = []
        for arrival_ns, data in kept:
            before = self._decoder.counters.packets
            found, numbers = self._decoder.feed(data)
            readings = self._decoder.counters.packets - before
            if not readings:
                continue
            self._follow(readings, arrival_ns)
            points.append(found)
            stamps.append(self._dated(readings, arrival_ns - self._delay_ns)[numbers])
        if any(map(len, points)):
            self._on_returns(Returns.plain(np.concatenate(points), np.concatenate(stamps)))

    def statistics(self) -> dict[str, int | float | None]:
        """Return counters of readings and returns, and of dropped data by reason."""
        return asdict(self._decoder.counters) | {
            "last_arrival_ns": self.last_arrival_ns,
            "rate_hz": self._rate_hz,
        }

    def _dated(self, count: int, newest_ns: int) -> NDArray[np.int64]:
        """Return the stamps of `count` readings, the last at `newest_ns`, none before the previous read."""
        since_ns = LONGEST_NS * count if self._last_ns is None else max(0, newest_ns - self._last_ns)
        step_ns = min(self._period_ns, since_ns // count)
        self._last_ns = newest_ns
        return np.asarray(newest_ns - np.arange(count, dtype=np.int64)[::-1] * step_ns)

    def _follow(self, readings: int, arrival_ns: int) -> None:
        """Update the rate of readings over the last whole second."""
        self.last_arrival_ns = arrival_ns
        if self._begun_ns is None:
            self._begun_ns = arrival_ns
            return
        self._count += readings
        elapsed_ns = arrival_ns - self._begun_ns
        if elapsed_ns >= SPAN_NS:
            self._rate_hz = self._count * 1e9 / elapsed_ns
            self._period_ns = min(LONGEST_NS, elapsed_ns // self._count)
            self._begun_ns, self._count = arrival_ns, 0
