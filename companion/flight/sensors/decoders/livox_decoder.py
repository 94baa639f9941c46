"""Decoder of the Livox Mid-360's packets (Livox LiDAR communication protocol for the Mid-360, v1.4).

A packet is a header of 36 bytes, little endian, and `dot_num` points. `length` counts the whole packet. The
checksum covers everything from the time stamp on. `timestamp` is the first point's time, `time_interval` the
time from the first point to the last. `udp_cnt` counts packets, either from zero in every frame or
continuously.

Points are forward, left, up of the sensor's centre. The Mid-360's four laser lines fire in turn, so a point's
line is its index in the packet modulo four, as in the maker's driver; each ray gives one return. A ray
without a return is a point of zeros; only spherical packets give its direction (`livox_scan_pattern`).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar
from zlib import crc32

import numpy as np

from companion.flight.sensors.decoders.livox_points import decode_points
from companion.flight.sensors.decoders.livox_scan_pattern import ScanPattern
from companion.flight.sensors.diagnosis.packet_signs import PacketSigns
from companion.flight.sensors.imu_samples import STANDARD_GRAVITY_MS2, ImuSamples
from companion.flight.sensors.returns import RawReturns, thinning

# version, length, time_interval (0.1 us), dot_num, udp_cnt, frame_cnt, data_type, time_type, 12 reserved,
# crc32, timestamp (ns)
HEADER = struct.Struct("<BHHHHBBB12xIQ")
CHECKED_FROM = 28
TYPE_AT = 10
POINT_BYTES = {1: 14, 2: 8, 3: 10}
REORDERED = 64  # a packet at most this much behind the newest is late; one farther behind starts a frame
MOST_NS = 2**62
THINNING = thinning(200_000)
TOGETHER = 64  # packets joined for one call, to fit the processor's cache
CLOCKS = ("free", "ptp", "gps")  # by time_type
WHITE = 150.0  # reflectivity of a target that scatters all light; more is retro-reflective


DATA_TYPE = 0
SAMPLE_BYTES = 24
LEVER_M = (0.011, 0.02329, -0.04412)


def decode_samples(body: bytes, stamp_ns: int, interval_ns: int) -> ImuSamples:
    """Return the samples of a packet's body.

    Parameters
    ----------
    body
        Whole samples, at least one.
    stamp_ns, interval_ns
        Time of the first sample on the sensor's clock, and time from the first to the last.
    """
    with np.errstate(invalid="ignore"):  # NaN that signals
        values = np.frombuffer(body, "<f4").reshape(-1, 6).astype(np.float64)
    steps = np.linspace(0, interval_ns, len(values)) if len(values) > 1 else np.zeros(1)
    return ImuSamples(
        stamp_ns + steps.astype(np.int64),
        values[:, :3],
        values[:, 3:] * STANDARD_GRAVITY_MS2,
        np.array(LEVER_M),
    )


@dataclass(slots=True)
class LivoxCounters:
    """Counters of received and dropped data.

    `unchecked` packets have a checksum of zero, which the protocol does not define: they are accepted,
    because UDP has a checksum of its own. `no_direction`: those of the rays without a return chosen for
    `lost` whose direction is unknown.
    """

    packets: int = 0
    imu: int = 0
    malformed: int = 0
    bad_checksum: int = 0
    unchecked: int = 0
    lost_packets: int = 0
    returns: int = 0
    no_return: int = 0
    low_confidence: int = 0
    no_direction: int = 0


@dataclass(slots=True)
class LivoxDecoder:
    """Decoder that stores packets and decodes them together; malformed ones are counted, never raised."""

    kind: ClassVar[str] = "livox"
    metadata: ClassVar[str] = ""

    counters: LivoxCounters = field(default_factory=LivoxCounters)
    signs: PacketSigns = field(default_factory=PacketSigns)
    _packets: list[bytes] = field(default_factory=list)
    _points: int = 0  # in `_packets`
    _next_count: int = 0  # expected number of the next packet
    _sound: tuple[bytes, tuple[int, ...]] = (b"", ())
    _pattern: ScanPattern = field(default_factory=ScanPattern)

    def __len__(self) -> int:
        """Return the number of packets stored and not decoded yet."""
        return len(self._packets)

    def check(self, packet: bytes) -> int | None:
        """Return the sensor's time of a packet's last point (ns), or None if it is no valid point packet.

        Dropped packets are counted.
        """
        header = self._header(packet)
        if header is None:
            return None
        _, length, interval, count, _, _, kind, _, _, stamp = header
        if kind == DATA_TYPE:
            self._samples(packet, header)
            return None
        size = POINT_BYTES.get(kind)
        if size is None or count == 0 or length != HEADER.size + count * size or stamp > MOST_NS:
            self.counters.malformed += 1
            return None
        self._sound = packet, header
        last_ns: int = stamp + interval * 100
        return last_ns

    def is_imu(self, packet: bytes) -> bool:
        """Return whether a packet claims to hold inertial samples."""
        return len(packet) >= HEADER.size and packet[TYPE_AT] == DATA_TYPE

    def decode_imu(self, packet: bytes) -> ImuSamples | None:
        """Return the samples of an inertial packet on the sensor's clock; None, counted, if it is invalid."""
        header = self._header(packet)
        return None if header is None else self._samples(packet, header)

    def _samples(self, packet: bytes, header: tuple[int, ...]) -> ImuSamples | None:
        _, length, interval, count, _, _, _, _, _, stamp = header
        samples = None
        if count and length == HEADER.size + count * SAMPLE_BYTES and stamp <= MOST_NS:
            samples = decode_samples(packet[HEADER.size :], stamp, interval * 100)
        if samples is None or not samples.is_plausible:
            self.counters.malformed += 1
            return None
        self.counters.imu += 1
        return samples

    def _header(self, packet: bytes) -> tuple[int, ...] | None:
        """Return the fields of a packet's header; None, counted, if length or checksum is wrong."""
        c = self.counters
        if len(packet) < HEADER.size:
            c.malformed += 1
            return None
        header = HEADER.unpack_from(packet)
        version, length, crc = header[0], header[1], header[8]
        if version != 0 or length != len(packet):
            c.malformed += 1
            return None
        if crc == 0:
            c.unchecked += 1
        elif crc32(packet[CHECKED_FROM:]) != crc:
            c.bad_checksum += 1
            return None
        return header

    def add_packet(self, packet: bytes) -> None:
        """Store a packet accepted by `check`."""
        checked, header = self._sound
        if checked is not packet:
            header = HEADER.unpack_from(packet)
        if header[4] == self._next_count:
            self._next_count += 1
        else:
            self._count_lost(header[4])
        self._packets.append(packet)
        points = header[3]
        self._points += points
        self.signs.covered_ns += header[2] * 100 * points // (points - 1 or 1)
        clock = header[7]
        self.signs.clock = CLOCKS[clock] if clock < len(CLOCKS) else ""

    def drain(self) -> RawReturns:
        """Decode the stored packets; points of low confidence are dropped and counted.

        Those without a return are counted, and thinned to `lost`.
        """
        most = self._points
        xyz = np.empty((most, 3), np.float32)
        stamps = np.empty(most, np.int64)
        intensity = np.empty(most, np.uint8)
        ring = np.empty(most, np.uint8)
        most_lost = most // THINNING + 1
        lost, lost_ns = np.empty((most_lost, 3), np.float32), np.empty(most_lost, np.int64)
        lost_ring = np.empty(most_lost, np.uint8)
        kept = n_lost = 0
        for first in range(0, len(self._packets), TOGETHER):
            data = np.frombuffer(b"".join(self._packets[first : first + TOGETHER]), np.uint8)
            returns, absent, doubtful, unanswered = decode_points(
                *(data, xyz[kept:], stamps[kept:], intensity[kept:], ring[kept:]),
                *(THINNING, self.counters.no_return, lost[n_lost:], lost_ns[n_lost:], lost_ring[n_lost:]),
            )
            kept += returns
            n_lost += unanswered
            self.counters.no_return += absent
            self.counters.low_confidence += doubtful
        self.counters.packets += len(self._packets)
        self._packets.clear()
        self._points = 0
        self.counters.returns += kept
        one = np.ones(kept, np.uint8)
        lost, lost_ns, lost_ring = lost[:n_lost], lost_ns[:n_lost], lost_ring[:n_lost]
        if n_lost or self._pattern.waiting:
            lost, lost_ns, absent = self._pattern.direct(
                xyz[:kept], stamps[:kept], ring[:kept], lost, lost_ns, lost_ring
            )
            self.counters.no_direction += absent
        return RawReturns(
            *(xyz[:kept], stamps[:kept], intensity[:kept], ring[:kept], one, one),
            lost=lost,
            lost_ns=lost_ns,
            lost_weight=float(THINNING),
            white=WHITE,
        )

    def decode(self, packets: Sequence[bytes]) -> RawReturns:
        """Check and decode packets together; without any return the arrays are empty."""
        for packet in packets:
            if self.check(packet) is not None:
                self.add_packet(packet)
        return self.drain()

    def _count_lost(self, udp_count: int) -> None:
        """Count gaps of a packet counter that is continuous or restarts with each frame."""
        newest = self._next_count - 1
        ahead = 0 if newest < 0 else (udp_count - newest - 1) % 65536
        if newest < 0 or ahead < 32768:
            self.counters.lost_packets += ahead
            self._next_count = udp_count + 1
        elif newest - udp_count <= min(REORDERED, newest // 2):
            # Late, and counted as lost when a later one overtook it; a duplicate is not a late packet.
            if udp_count != newest and self.counters.lost_packets:
                self.counters.lost_packets -= 1
        else:
            self.counters.lost_packets += udp_count  # a new frame, whose first packets may be missing
            self._next_count = udp_count + 1
