"""Endless streams of real packets of the simulated sensors, fed to the driver by a simulated clock.

A second of each sensor's packets is made by the simulator and repeated, with new stamps, numbers and
checksums, so that hours of a stream cost no ray tracing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from math import gcd

import numpy as np

from companion.flight.sensors.diagnosis.lidar_diagnosis import Episode
from companion.flight.sensors.packet_stream import PacketStream
from companion.flight.sensors.sensor_registry import decoder_for
from params import Parameters
from sitl.faults import packet_edit
from sitl.sensors.mid360 import Mid360
from sitl.sensors.ouster_os1 import Ouster
from sitl.sensors.sensor_clock import Clock
from sitl.sensors.vlp16 import Vlp16
from tests.unit.sitl.still_world import flat_world, hover

S, MS = 1_000_000_000, 1_000_000
SENSOR = Clock(offset_ns=7 * S, drift_ppb=0)
DRIFT_PPM = 12.0
BATCH_NS, LOOK_NS = 10 * MS, 250 * MS
LATE_NS = 300_000
WALL_NS = 1_700_000_000 * S

Treat = Callable[[list[bytes]], list[bytes]]


@dataclass(frozen=True, slots=True)
class Loop:
    """A second of packets: period of the loop, time from packet to packet, metadata."""

    kind: str
    packets: tuple[bytes, ...]
    packet_ns: float
    metadata: str = ""


@lru_cache(maxsize=4)
def loop_of(sensor: str, seconds: float = 1.0) -> Loop:
    """Return about a second of a sensor's packets, 10 m above grass."""
    rng, world, pose = np.random.default_rng(3), flat_world(), hover()
    metadata = ""
    if sensor == "mid360":
        made: Mid360 | Vlp16 | Ouster = Mid360(rng, clock=SENSOR)
        kind, packet_ns, whole = "livox", 480_000.0, 1
    elif sensor == "vlp16":
        made = Vlp16(rng, clock=SENSOR)
        kind, packet_ns, whole = "velodyne", 24 * 55_296.0, 1
    else:
        made = Ouster(rng, clock=SENSOR)
        kind, packet_ns, whole, metadata = (
            "ouster",
            100e6 / packet_edit.PACKETS_OF_FRAME,
            packet_edit.PACKETS_OF_FRAME,
            made.metadata,
        )
    packets = []
    for k in range(round(seconds * 10)):
        packets += made.scan(k * 100 * MS, (k + 1) * 100 * MS, pose, world)
    packets = packets[: len(packets) // whole * whole]
    assert gcd(whole, len(packets)) == whole
    return Loop(kind, tuple(packets), packet_ns, metadata)


def packet_at(loop: Loop, number: int, *, drift_ppm: float = DRIFT_PPM, ahead_ns: int = 0) -> bytes:
    """Return the n-th packet of an endless stream; its sensor runs fast, and its clock is ahead."""
    stamp_ns = SENSOR.offset_ns + ahead_ns + round(number * loop.packet_ns * (1 + drift_ppm * 1e-6))
    packet = packet_edit.numbered(loop.packets[number % len(loop.packets)], number)
    return packet_edit.restamped(packet, lambda _: stamp_ns)


@dataclass(slots=True)
class Told:
    """A cause that began, and when, s."""

    at_s: float
    cause: str


class Bench:
    """A driver's stream whose packets arrive by a simulated clock, 0.3 ms late and with jitter.

    Attributes
    ----------
    told
        Causes in the order in which they began.
    """

    def __init__(self, loop: Loop, seed: int = 1, **settings: object) -> None:
        self.loop = loop
        self.stream = PacketStream(
            decoder_for(loop.kind, loop.metadata),
            Parameters(**settings),  # type: ignore[arg-type]
            lambda returns: None,
            lambda: WALL_NS,
        )
        self.told: list[Told] = []
        self._rng = np.random.default_rng(seed)
        self._flushed_ns = self._looked_ns = 0
        self._seen: set[int] = set()
        self._newest_ns = 0

    @property
    def episodes(self) -> list[Episode]:
        """All episodes."""
        return self.stream.diagnosis.episodes

    def feed(self, packets: Iterator[tuple[int, bytes]]) -> None:
        """Receive packets at their arrivals."""
        for arrival_ns, packet in packets:
            self.pass_time(arrival_ns)
            self.stream.add_packet(packet, "192.168.1.100", arrival_ns)

    def pass_time(self, now_ns: int) -> None:
        """Flush and look, as the driver's timers do, up to a time."""
        while self._flushed_ns + BATCH_NS <= now_ns:
            self._flushed_ns += BATCH_NS
            if len(self.stream):
                self.stream.flush(self._flushed_ns)
            if self._flushed_ns - self._looked_ns >= LOOK_NS:
                self._looked_ns = self._flushed_ns
                self.stream.diagnosis.check(self._flushed_ns)
            self._note(self._flushed_ns)

    def arrivals(
        self, first: int, last: int, treat: Treat | None = None, **made: float
    ) -> Iterator[tuple[int, bytes]]:
        """Yield packets `first` to `last` with their arrivals, as changed by a fault."""
        loop = self.loop
        for number in range(first, last):
            at_ns = round((number + 1) * loop.packet_ns) + LATE_NS + int(self._rng.exponential(50_000))
            at_ns = self._newest_ns = max(at_ns, self._newest_ns + 1000)
            packet = packet_at(loop, number, **made)  # type: ignore[arg-type]
            for one in [packet] if treat is None else treat([packet]):
                yield at_ns, one

    def number_at(self, seconds: float) -> int:
        """Return the number of the first packet after a time."""
        return round(seconds * 1e9 / self.loop.packet_ns)

    def _note(self, now_ns: int) -> None:
        for episode in self.stream.diagnosis.active:
            if id(episode) not in self._seen:
                self._seen.add(id(episode))
                self.told.append(Told(now_ns * 1e-9, episode.cause))
