"""slz with one more LiDAR: `python own_sensor.py run --mavlink URL --lidar toy:0.0.0.0:7700`.

The toy's packets, little endian: "TOY1", number (u16), count (u16), time of the first point (u64, ns), time
from point to point (u32, ns); then for each point x forward, y right, z down (i32, mm) and intensity (u8). A
point of zeros is no return.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np

from companion.cli.program import main
from companion.flight.sensors.returns import RawReturns
from companion.flight.sensors.sensor_registry import add_sensor

HEADER = struct.Struct("<4sHHQI")
POINT = np.dtype([("xyz_mm", "<i4", 3), ("intensity", "u1")])
MOST_NS = 2**62  # later stamps are nonsense, and would overflow


@dataclass(slots=True)
class ToyCounters:
    """What came, and what was dropped and why."""

    packets: int = 0
    malformed: int = 0
    lost_packets: int = 0
    returns: int = 0
    no_return: int = 0


class ToyDecoder:
    """Checks packets one by one and decodes them together; it raises nothing, whatever comes."""

    kind = "toy"
    metadata = ""

    def __init__(self) -> None:
        self.counters = ToyCounters()
        self._kept: list[bytes] = []
        self._next: int | None = None

    def __len__(self) -> int:
        """Return the number of packets kept."""
        return len(self._kept)

    def check(self, packet: bytes) -> int | None:
        """Return the time of the last point (ns), None for what is no packet."""
        if len(packet) >= HEADER.size:
            magic, _, count, first_ns, step_ns = HEADER.unpack_from(packet)
            whole = count > 0 and len(packet) == HEADER.size + count * POINT.itemsize
            if magic == b"TOY1" and whole and first_ns < MOST_NS:
                return int(first_ns + (count - 1) * step_ns)
        self.counters.malformed += 1
        return None

    def add_packet(self, packet: bytes) -> None:
        """Keep a sound packet, and count those that are missing before it."""
        number = HEADER.unpack_from(packet)[1]
        ahead = 0 if self._next is None else (number - self._next) % 65536
        if ahead < 32768:  # else it is a late one
            self.counters.lost_packets += ahead
            self._next = (number + 1) % 65536
        self.counters.packets += 1
        self._kept.append(packet)

    def drain(self) -> RawReturns:
        """Decode what was kept: forward, left, up in metres, each point with a stamp of its own."""
        points, stamps = [], []
        for packet in self._kept:
            _, _, count, first_ns, step_ns = HEADER.unpack_from(packet)
            points.append(np.frombuffer(packet, POINT, count, HEADER.size))
            stamps.append(first_ns + step_ns * np.arange(count, dtype=np.int64))
        self._kept.clear()
        all_points = np.concatenate(points) if points else np.empty(0, POINT)
        stamp_ns = np.concatenate(stamps) if stamps else np.empty(0, np.int64)
        hit = all_points["xyz_mm"].any(axis=1)
        self.counters.returns += int(hit.sum())
        self.counters.no_return += int((~hit).sum())
        xyz_m = (all_points["xyz_mm"][hit] * (0.001, -0.001, -0.001)).astype(np.float32)
        one = np.ones(len(xyz_m), np.uint8)
        intensity = np.ascontiguousarray(all_points["intensity"][hit])
        return RawReturns(xyz_m, stamp_ns[hit], intensity, np.zeros_like(one), one, one)


if __name__ == "__main__":
    add_sensor("toy", ToyDecoder, default_port=7700)
    main()
