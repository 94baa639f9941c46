"""Decoder of the Livox Mid-360's point packets (Livox LiDAR communication protocol for the Mid-360, v1.4).

A packet is a header of 36 bytes, little endian, and `dot_num` points. The checksum covers everything from the
time stamp on. Points are given forward, left, up of the sensor's centre.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

# version, length, time_interval (0.1 us), dot_num, udp_cnt, frame_cnt, data_type, time_type, 12 reserved,
# crc32, timestamp (ns)
HEADER = struct.Struct("<BHHHHBBB12xIQ")
CHECKED_FROM = 28
CARTESIAN_MM = np.dtype([("xyz", "<i4", 3), ("reflectivity", "u1"), ("tag", "u1")])
CARTESIAN_CM = np.dtype([("xyz", "<i2", 3), ("reflectivity", "u1"), ("tag", "u1")])
SPHERICAL = np.dtype([("depth", "<u4"), ("angles", "<u2", 2), ("reflectivity", "u1"), ("tag", "u1")])
FORMATS = {1: CARTESIAN_MM, 2: CARTESIAN_CM, 3: SPHERICAL}
IMU = 0
# Tag bits 0-1, 2-3 and 4-5: confidence that the return is a glue point, an atmospheric particle, or other;
# 0 is high confidence (a normal point), 1 moderate, 2 low.
LOW_CONFIDENCE = 2


@dataclass(slots=True)
class LivoxCounters:
    """What came, and what was dropped and why."""

    packets: int = 0
    imu: int = 0
    malformed: int = 0
    bad_checksum: int = 0
    lost_packets: int = 0
    returns: int = 0
    no_return: int = 0
    low_confidence: int = 0


@dataclass(frozen=True, slots=True)
class RawReturns:
    """Decoded points on the sensor's clock: (n, 3) float32 m, (n,) int64 ns, (n,) uint8."""

    xyz_m: NDArray[np.float32]
    stamp_ns: NDArray[np.int64]
    intensity: NDArray[np.uint8]


@dataclass(slots=True)
class LivoxDecoder:
    """Decodes packets; malformed ones are counted and dropped, never raised."""

    counters: LivoxCounters = field(default_factory=LivoxCounters)
    _udp_count: int | None = None

    def stamp_of(self, packet: bytes) -> int | None:
        """Return the sensor time of a packet's last point, or None if it is no point packet."""
        if len(packet) < HEADER.size:
            return None
        _, _, interval, _, _, _, kind, _, _, stamp = HEADER.unpack_from(packet)
        return stamp + interval * 100 if kind in FORMATS else None

    def decode(self, packets: Sequence[bytes]) -> RawReturns:
        """Decode packets together; without any return the arrays are empty."""
        points, stamps, intensities = [], [], []
        for packet in packets:
            decoded = self._packet(packet)
            if decoded is not None:
                points.append(decoded[0])
                stamps.append(decoded[1])
                intensities.append(decoded[2])
        if not points:
            return RawReturns(np.zeros((0, 3), np.float32), np.zeros(0, np.int64), np.zeros(0, np.uint8))
        return RawReturns(np.concatenate(points), np.concatenate(stamps), np.concatenate(intensities))

    def _packet(
        self, packet: bytes
    ) -> tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.uint8]] | None:
        c = self.counters
        if len(packet) < HEADER.size:
            c.malformed += 1
            return None
        _, length, interval, count, udp_count, _, kind, _, crc, stamp = HEADER.unpack_from(packet)
        if kind == IMU:
            c.imu += 1
            return None
        form = FORMATS.get(kind)
        if (
            form is None
            or not count
            or length != len(packet)
            or length != HEADER.size + count * form.itemsize
        ):
            c.malformed += 1
            return None
        if zlib.crc32(packet[CHECKED_FROM:]) != crc:
            c.bad_checksum += 1
            return None
        c.packets += 1
        self._count_lost(udp_count)
        raw = np.frombuffer(packet, form, count, HEADER.size)
        xyz = _metres(raw, kind)
        tag = raw["tag"]
        present = np.any(xyz != 0, axis=1)
        sure = (
            ((tag & 3) < LOW_CONFIDENCE)
            & ((tag >> 2 & 3) < LOW_CONFIDENCE)
            & ((tag >> 4 & 3) < LOW_CONFIDENCE)
        )
        keep = present & sure
        c.no_return += int(count - present.sum())
        c.low_confidence += int((present & ~sure).sum())
        c.returns += int(keep.sum())
        # The interval spans from the first point of the packet to the last.
        times = stamp + (np.arange(count) * (interval * 100) // max(1, count - 1)).astype(np.int64)
        return xyz[keep], times[keep], raw["reflectivity"][keep]

    def _count_lost(self, udp_count: int) -> None:
        """Count gaps of a running counter; one that begins anew with each frame shows no gap at its end."""
        if self._udp_count is not None and udp_count != 0:
            gap = (udp_count - self._udp_count - 1) % 65536
            self.counters.lost_packets += gap if gap < 32768 else 0
        self._udp_count = udp_count


def _metres(raw: NDArray[np.void], kind: int) -> NDArray[np.float32]:
    if kind == 3:
        depth = raw["depth"] * np.float32(1e-3)
        theta = np.radians(raw["angles"][:, 0] * np.float32(0.01))  # from the z axis
        phi = np.radians(raw["angles"][:, 1] * np.float32(0.01))  # from x towards y
        across = depth * np.sin(theta)
        xyz = np.stack([across * np.cos(phi), across * np.sin(phi), depth * np.cos(theta)], axis=1)
        return xyz.astype(np.float32)
    return raw["xyz"] * np.float32(1e-3 if kind == 1 else 1e-2)
