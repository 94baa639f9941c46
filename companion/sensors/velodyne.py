"""Decoder of Velodyne's VLP-16, Puck Hi-Res and VLP-32C (user manuals 63-9243 and 63-9325).

A packet of 1206 bytes, little endian, is 12 blocks of flag, azimuth (0.01 degree) and 32 measurements, then a
stamp and two factory bytes: return mode and model. The stamp counts microseconds past the hour, and is when
the packet's first laser fired. Every 55.296 us all 16 lasers (VLP-16) or 16 pairs (VLP-32C) fire once,
2.304 us apart. In dual mode blocks come in pairs, the last return and the strongest.

The library `velodyne-decoder` makes points of packets that are found sound here.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from velodyne_decoder import Config, Model, PacketVector, ScanDecoder, VelodynePacket
from velodyne_decoder.velodyne_decoder_pylib import TimePair

from companion.sensors.returns import RawReturns, join_raw, nothing

PACKET_BYTES = 1206
POSITION_BYTES = (512, 554)  # as payload, and with the frame's headers as some loggers forward it
BLOCKS = struct.Struct("<" + "HH96x" * 12)
TAIL = struct.Struct("<IBB")
TAIL_AT = 1200
MODEL_AT = 1205
FLAGS = (0xEEFF,) * 12
CIRCLE = 36_000
SINGLE, DUAL = (0x37, 0x38), 0x39
MODELS = {0x22: Model.VLP16, 0x24: Model.PuckHiRes, 0x28: Model.VLP32C}
FIRINGS = {0x22: 24, 0x24: 24, 0x28: 12}  # firing sequences of a packet in single mode

HOUR_NS = 3_600_000_000_000
HOUR_US = 3_600_000_000
TICK_NS = 2_304  # between two lasers; a whole sequence is 24 of them
SEQUENCE_NS = 24 * TICK_NS
LAST_LASER_NS = 15 * TICK_NS
PAUSE_NS = 1_000_000_000  # a longer gap is a sensor switched off, not lost packets
LATE_NS = 20_000_000
MOST_M = 300.0
RAYS = 384  # of a packet in single mode
SLOT_S = 1 / 512  # packets are given to the library so far apart, to tell its points' packets by their time
LAST, STRONGEST = 2, 1


@dataclass(slots=True)
class VelodyneCounters:
    """What came, and what was dropped and why."""

    packets: int = 0
    position: int = 0
    malformed: int = 0
    lost_packets: int = 0
    returns: int = 0
    no_return: int = 0


@dataclass(slots=True)
class VelodyneDecoder:
    """Takes packets one by one and decodes them together; malformed ones are counted, never raised."""

    kind: ClassVar[str] = "velodyne"
    setup: ClassVar[str] = ""

    counters: VelodyneCounters = field(default_factory=VelodyneCounters)
    _packets: list[bytes] = field(default_factory=list)
    _stamps_ns: list[int] = field(default_factory=list)
    _decoders: dict[int, ScanDecoder] = field(default_factory=dict)
    _newest_ns: int | None = None

    def __len__(self) -> int:
        """Return the number of packets taken and not decoded yet."""
        return len(self._packets)

    def check(self, packet: bytes) -> int | None:
        """Return the sensor's time of a packet's last point (ns), or None for what is no sound point packet.

        The time goes on over the turn of the hour. What is dropped is counted.
        """
        if len(packet) in POSITION_BYTES:
            self.counters.position += 1
            return None
        if not _is_sound(packet):
            self.counters.malformed += 1
            return None
        return self._stamp_ns(packet) + _duration_ns(packet) - SEQUENCE_NS + LAST_LASER_NS

    def take(self, packet: bytes) -> None:
        """Keep a packet that `check` found sound."""
        stamp_ns = self._stamp_ns(packet)
        self.counters.packets += 1
        self._count_lost(stamp_ns, _duration_ns(packet))
        self._packets.append(packet)
        self._stamps_ns.append(stamp_ns)

    def drain(self) -> RawReturns:
        """Decode the packets taken; rays without a return are dropped and counted."""
        parts, at = [nothing()], 0
        for model, group in groupby(self._packets, key=lambda packet: packet[MODEL_AT]):
            packets = list(group)
            parts.append(self._decode(model, packets, self._stamps_ns[at : at + len(packets)]))
            at += len(packets)
        self._packets.clear()
        self._stamps_ns.clear()
        raw = join_raw(parts)
        self.counters.returns += len(raw)
        return raw

    def decode(self, packets: Sequence[bytes]) -> RawReturns:
        """Check and decode packets together; without any return the arrays are empty."""
        for packet in packets:
            if self.check(packet) is not None:
                self.take(packet)
        return self.drain()

    def _decode(self, model: int, packets: list[bytes], stamps_ns: list[int]) -> RawReturns:
        vector = PacketVector(
            [VelodynePacket(TimePair(0.0, i * SLOT_S), list(packet)) for i, packet in enumerate(packets)]
        )
        _, cloud = self._library(model).decode(vector, as_pcl_structs=True)
        time_s = cloud["time"].astype(np.float64)
        number = np.floor(time_s / SLOT_S).astype(np.int64)
        ticks = np.rint((time_s - number * SLOT_S) * (1e9 / TICK_NS)).astype(np.int64)
        stamp_ns = np.array(stamps_ns, np.int64)[number] + ticks * TICK_NS
        xyz = np.ascontiguousarray(cloud.view(np.float32).reshape(-1, 8)[:, :3])
        ring = np.ascontiguousarray(cloud["ring"])
        echo, echoes = _echoes(cloud["return_type"], ring, stamp_ns, xyz)
        rays = sum(RAYS // 2 if packet[MODEL_AT - 1] == DUAL else RAYS for packet in packets)
        self.counters.no_return += rays - int(np.count_nonzero(echo == 1))
        return RawReturns(xyz, stamp_ns, cloud["intensity"].astype(np.uint8), ring, echo, echoes)

    def _library(self, model: int) -> ScanDecoder:
        if model not in self._decoders:
            config = Config(model=MODELS[model], min_range=0.0, max_range=MOST_M, timestamp_first_packet=True)
            self._decoders[model] = ScanDecoder(config)
        return self._decoders[model]

    def _stamp_ns(self, packet: bytes) -> int:
        """Return a packet's stamp in the hour that brings it nearest to the packet taken last."""
        past_hour_ns = int.from_bytes(packet[TAIL_AT : TAIL_AT + 4], "little") * 1000
        if self._newest_ns is None:
            return HOUR_NS + past_hour_ns  # no stamp before the first is negative
        return past_hour_ns + round((self._newest_ns - past_hour_ns) / HOUR_NS) * HOUR_NS

    def _count_lost(self, stamp_ns: int, duration_ns: int) -> None:
        """Count the packets that would have filled a gap; packets carry no number."""
        ahead_ns = 0 if self._newest_ns is None else stamp_ns - self._newest_ns
        if -LATE_NS < ahead_ns < 0:
            # Late, and counted as lost when a later one overtook it.
            self.counters.lost_packets = max(0, self.counters.lost_packets - 1)
            return
        if 0 < ahead_ns < PAUSE_NS:
            self.counters.lost_packets += max(0, round(ahead_ns / duration_ns) - 1)
        self._newest_ns = stamp_ns


def _is_sound(packet: bytes) -> bool:
    """Return whether a packet is one of a known model, whole and with every azimuth within the circle."""
    if len(packet) != PACKET_BYTES:
        return False
    blocks = BLOCKS.unpack_from(packet)
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
    return FIRINGS[model] * SEQUENCE_NS // (2 if mode == DUAL else 1)


def _echoes(
    kind: NDArray[np.uint8], ring: NDArray[np.uint8], stamp_ns: NDArray[np.int64], xyz_m: NDArray[np.float32]
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return number and count of each return along its ray: the nearer of a last and a strongest is first.

    The library puts the two of a ray one after the other, and makes one of two that are the same.
    """
    echo, echoes = np.ones(len(kind), np.uint8), np.ones(len(kind), np.uint8)
    pair = (kind[:-1] == LAST) & (kind[1:] == STRONGEST)
    pair &= (ring[:-1] == ring[1:]) & (stamp_ns[:-1] == stamp_ns[1:])
    (first,) = np.nonzero(pair)
    if first.size:
        squared_m2 = np.einsum("ij,ij->i", xyz_m, xyz_m)
        echoes[first] = echoes[first + 1] = 2
        echo[np.where(squared_m2[first] > squared_m2[first + 1], first, first + 1)] = 2
    return echo, echoes
