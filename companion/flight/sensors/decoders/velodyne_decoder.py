"""Decoder of Velodyne's VLP-16, Puck Hi-Res and VLP-32C (user manuals 63-9243 and 63-9325).

A packet of 1206 bytes, little endian, is 12 blocks of flag, azimuth (0.01 degree) and 32 measurements, then a
stamp and two factory bytes: return mode and model. The stamp is the time of the packet's first laser, in
microseconds past the hour. Every 55.296 us all 16 lasers (VLP-16) or 16 pairs (VLP-32C) fire once, 2.304 us
apart. In dual mode blocks come in pairs, the last return and the strongest.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from companion.flight.sensors.decoders.velodyne_points import (
    BLOCK_TICKS,
    BLOCKS,
    DUAL,
    MODEL_AT,
    MODELS,
    NUMBER,
    PLACES,
    RING,
    SEQUENCE_TICKS,
    SEQUENCES,
    SHAPE,
    TAIL_AT,
    THINNING,
    TICK_NS,
    TICKS,
    place_rays,
)
from companion.flight.sensors.diagnosis.packet_signs import PacketSigns
from companion.flight.sensors.returns import RawReturns, nothing

PACKET_BYTES = 1206
POSITION_BYTES = (512, 554)  # payload, and with the network headers as some loggers forward it
HEADS = struct.Struct("<" + "HH96x" * 12)
TAIL = struct.Struct("<IBB")
FLAGS = (0xEEFF,) * 12
CIRCLE = 36_000
SINGLE = (0x37, 0x38)

HOUR_NS = 3_600_000_000_000
HOUR_US = 3_600_000_000
SEQUENCE_NS = SEQUENCE_TICKS * TICK_NS
LAST_LASER_NS = 15 * TICK_NS
PAUSE_NS = 1_000_000_000  # a longer gap means a sensor that was off, not lost packets
LATE_NS = 20_000_000
LEAST_THINNING = int(THINNING.min())
SECTORS = 36
NEAR_M = 0.45  # below the least range of the data sheet: the window
PULSE_AT, NMEA_AT = 202, 206  # in a position packet
PULSES = {0: "no PPS", 1: "PPS not locked", 3: "PPS faulty"}
WHITE = 100.0  # calibrated reflectivity of a target that scatters all light; more is retro-reflective


@dataclass(slots=True)
class VelodyneCounters:
    """Counters of received and dropped data."""

    packets: int = 0
    position: int = 0
    malformed: int = 0
    lost_packets: int = 0
    returns: int = 0
    no_return: int = 0


def _signs() -> PacketSigns:
    return PacketSigns(azimuth_packets=[0] * SECTORS, lines=PLACES, near_m=NEAR_M)


@dataclass(slots=True)
class VelodyneDecoder:
    """Decoder that stores packets and decodes them together; malformed ones are counted, never raised."""

    kind: ClassVar[str] = "velodyne"
    metadata: ClassVar[str] = ""

    counters: VelodyneCounters = field(default_factory=VelodyneCounters)
    signs: PacketSigns = field(default_factory=_signs)
    _packets: list[bytes] = field(default_factory=list)
    _stamps_ns: list[int] = field(default_factory=list)
    _newest_ns: int | None = None

    def __len__(self) -> int:
        """Return the number of packets stored and not decoded yet."""
        return len(self._packets)

    def check(self, packet: bytes) -> int | None:
        """Return the sensor's time of a packet's last point (ns), or None if it is no valid point packet.

        The time is unwrapped across full hours. Dropped packets are counted.
        """
        if len(packet) in POSITION_BYTES:
            self.counters.position += 1
            self.signs.clock, self.signs.pulse = _position(packet[-512:])
            return None
        if not _is_sound(packet):
            self.counters.malformed += 1
            return None
        return self._stamp_ns(packet) + _duration_ns(packet) - SEQUENCE_NS + LAST_LASER_NS

    def add_packet(self, packet: bytes) -> None:
        """Store a packet accepted by `check`."""
        stamp_ns, duration_ns = self._stamp_ns(packet), _duration_ns(packet)
        self.counters.packets += 1
        self.signs.covered_ns += duration_ns
        self.signs.azimuth_packets[int.from_bytes(packet[2:4], "little") * SECTORS // CIRCLE] += 1
        self._count_lost(stamp_ns, duration_ns)
        self._packets.append(packet)
        self._stamps_ns.append(stamp_ns)

    def drain(self) -> RawReturns:
        """Decode the stored packets; rays without a return are counted, and thinned to `lost`."""
        n = len(self._packets)
        if not n:
            return nothing()
        packets = np.frombuffer(b"".join(self._packets), np.uint8).reshape(n, PACKET_BYTES)
        most = n * BLOCKS * PLACES
        xyz_m, stamp_ns = np.empty((most, 3), np.float32), np.empty(most, np.int64)
        intensity, ring, echo, echoes = np.empty((4, most), np.uint8)
        most_lost = most // LEAST_THINNING + 1
        lost, lost_ns = np.empty((most_lost, 3), np.float32), np.empty(most_lost, np.int64)
        kept, absent, n_lost = place_rays(
            packets, np.array(self._stamps_ns), NUMBER, SHAPE, TICKS, RING, BLOCK_TICKS,
            THINNING, self.counters.no_return,
            xyz_m, stamp_ns, intensity, ring, echo, echoes, lost, lost_ns,
        )  # fmt: skip
        model = NUMBER[packets[-1, MODEL_AT]]
        self._packets.clear()
        self._stamps_ns.clear()
        self.counters.returns += kept
        self.counters.no_return += absent
        return RawReturns(
            *(xyz_m[:kept], stamp_ns[:kept], intensity[:kept], ring[:kept], echo[:kept], echoes[:kept]),
            lost=lost[:n_lost],
            lost_ns=lost_ns[:n_lost],
            lost_weight=float(THINNING[model]),
            white=WHITE,
        )

    def decode(self, packets: Sequence[bytes]) -> RawReturns:
        """Check and decode packets together; without any return the arrays are empty."""
        for packet in packets:
            if self.check(packet) is not None:
                self.add_packet(packet)
        return self.drain()

    def _stamp_ns(self, packet: bytes) -> int:
        """Return a packet's stamp, unwrapped to the hour nearest to the newest packet."""
        past_hour_ns = int.from_bytes(packet[TAIL_AT : TAIL_AT + 4], "little") * 1000
        if self._newest_ns is None:
            return HOUR_NS + past_hour_ns  # one hour ahead, so that no earlier stamp is negative
        return past_hour_ns + round((self._newest_ns - past_hour_ns) / HOUR_NS) * HOUR_NS

    def _count_lost(self, stamp_ns: int, duration_ns: int) -> None:
        """Count the packets that would have filled a gap, because packets carry no number."""
        ahead_ns = 0 if self._newest_ns is None else stamp_ns - self._newest_ns
        if -LATE_NS < ahead_ns < 0:
            # Late, and counted as lost when a later one overtook it.
            self.counters.lost_packets = max(0, self.counters.lost_packets - 1)
            return
        if 0 < ahead_ns < PAUSE_NS:
            self.counters.lost_packets += max(0, round(ahead_ns / duration_ns) - 1)
        self._newest_ns = stamp_ns


def _position(payload: bytes) -> tuple[str, str]:
    """Return the source of the stamps by a position packet, and what is wrong with the receiver's signals."""
    sentence = payload[NMEA_AT:].split(b"\r", 1)[0].split(b"\0", 1)[0].decode("ascii", "replace")
    parts = sentence.split(",")
    fault = PULSES.get(payload[PULSE_AT], "")
    if not fault and not parts[0].endswith("RMC"):
        fault = "no GPRMC"
    elif not fault and (len(parts) < 3 or parts[2] != "A"):
        fault = "GPRMC not valid"
    return "free" if fault else "gps", fault


def _is_sound(packet: bytes) -> bool:
    """Return whether a packet is complete, of a known model, and has every azimuth within the circle."""
    if len(packet) != PACKET_BYTES:
        return False
    blocks = HEADS.unpack_from(packet)
    past_hour_us, mode, model = TAIL.unpack_from(packet, TAIL_AT)
    return (
        blocks[::2] == FLAGS
        and max(blocks[1::2]) < CIRCLE
        and past_hour_us < HOUR_US
        and (mode in SINGLE or mode == DUAL)
        and model in MODELS
    )


def _duration_ns(packet: bytes) -> int:
    """Return the time from a packet's first firing to the next packet's."""
    _, mode, model = TAIL.unpack_from(packet, TAIL_AT)
    return SEQUENCES[model] * SEQUENCE_NS // (2 if mode == DUAL else 1)
