"""Decoder of an interferometric radar's datagrams (`docs/instruments.md`): one line of complex samples each.

Lines are gathered into blocks of one range gate, and each block is phase-unwrapped as a whole. Its points are
in the sensor frame: forward, left, up of the antennas, the radar looking right. So the vehicle's own pose
places them, line by line, like a LiDAR's returns. With pitch, the ground in the beam's plane is farther away
than the reported altitude, and no datagram contains the pitch: each block carries the greatest pitch for
which its points are valid.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from companion.flight.sensors.returns import RawReturns, join_raw, nothing
from slz.radar.heights import heights
from slz.radar.interferogram import RadarLines, interferogram
from slz.radar.interferometer import Interferometer

MAGIC = b"SLZR"
VERSION = 1
HEADER = struct.Struct("<4sBBHIQdfffffffff")
BLOCK = 8
MOST_NS = 2**62
CLIPPED = 32767  # full scale of the converter: the value of all stronger samples
MOST_BLOCK_NS = 3_000_000_000
LEAST_UNIT, MOST_UNIT = 1e-9, 1e6  # limits of a sample's unit, so that squares do not overflow
MOST_SIGMA_M = 0.10
"""Less certain points are dropped, because the map weights all points of a sensor equally."""
MOST_TURN = 0.25
"""Greatest change of ground distance caused by pitch, in heights of one phase turn; 0.5 makes all wrong."""


@dataclass(slots=True)
class RadarCounters:
    """Counters of received and dropped data; `no_return` samples lack coherence or are too uncertain."""

    packets: int = 0
    malformed: int = 0
    lost_packets: int = 0
    blocks: int = 0
    broken_blocks: int = 0
    returns: int = 0
    no_return: int = 0


@dataclass(frozen=True, slots=True)
class _Line:
    radar: Interferometer
    number: int
    stamp_ns: int
    first_m: float
    step_m: float
    altitude_m: float
    roll_rad: float
    samples: NDArray[np.complex64] = field(repr=False)
    clipped: NDArray[np.bool_] = field(repr=False)

    def follows(self, other: _Line) -> bool:
        """Return whether two lines belong to one block."""
        same = (self.radar, self.first_m, self.step_m) == (other.radar, other.first_m, other.step_m)
        later = 0 < self.stamp_ns - other.stamp_ns < MOST_BLOCK_NS
        return same and later and self.samples.shape == other.samples.shape


class RadarDecoder:
    """Decoder that gathers lines into blocks and converts blocks to points."""

    kind: ClassVar[str] = "radar"
    metadata: ClassVar[str] = ""

    def __init__(self) -> None:
        self.counters = RadarCounters()
        self._packets = 0
        self._block: list[_Line] = []
        self._last: int | None = None
        self._done: list[RawReturns] = []

    def __len__(self) -> int:
        """Return the number of packets since the last `drain`."""
        return self._packets

    def check(self, packet: bytes) -> int | None:
        """Return the time of a line (ns), or None, counted as malformed, if the packet is no line."""
        line = _line(packet)
        if line is None:
            self.counters.malformed += 1
            return None
        return line.stamp_ns

    def add_packet(self, packet: bytes) -> None:
        """Store a line."""
        line = _line(packet)
        if line is None:
            return
        self._packets += 1
        self.counters.packets += 1
        if self._last is not None and 1 < line.number - self._last < 1000:
            self.counters.lost_packets += line.number - self._last - 1
        self._last = line.number
        if self._block and not line.follows(self._block[-1]):
            self._finish()
        self._block.append(line)
        if len(self._block) == BLOCK:
            self._finish()

    def drain(self) -> RawReturns:
        """Return the points of the finished blocks."""
        self._packets = 0
        done, self._done = self._done, []
        return join_raw(done) if done else nothing()

    def _finish(self) -> None:
        block, self._block = self._block, []
        self.counters.blocks += 1
        try:
            self._done += _points(block, self.counters)
        except ValueError:  # too few lines, or none of them reaches the ground
            self.counters.broken_blocks += 1


def _points(block: list[_Line], counters: RadarCounters) -> list[RawReturns]:
    altitude = np.array([line.altitude_m for line in block])
    roll = np.array([line.roll_rad for line in block])
    lines = RadarLines(
        np.stack([line.samples for line in block]),
        block[0].first_m,
        block[0].step_m,
        np.column_stack([np.zeros((len(block), 2)), altitude]),
        0.0,
        roll,
    )
    radar = block[0].radar
    image = interferogram(lines, radar)
    image.coherence[np.stack([line.clipped for line in block])] = 0.0  # clipping corrupts the phase
    found = heights(image, lines, radar)
    good = found.sigma_m < MOST_SIGMA_M
    counters.returns += int(good.sum())
    counters.no_return += lines.samples.shape[0] * lines.samples.shape[3] - int(good.sum())
    if not good.any():
        return []
    line, way = found.line[good], found.range_m[good]
    look = found.look_rad[good] - roll[line]
    xyz = np.column_stack([np.zeros(len(way)), -way * np.sin(look), -way * np.cos(look)]).astype(np.float32)
    stamps = np.array([one.stamp_ns for one in block], np.int64)[line]
    none, unknown = np.zeros(len(way), np.uint8), np.full(len(way), np.nan, np.float32)
    further = MOST_TURN * float(np.median(found.turn_m[good])) / float(altitude.max())
    most_pitch = float(np.arccos(1 / (1 + further)))
    return [
        RawReturns(xyz, stamps, unknown, none, none, none, most_pitch_rad=most_pitch, has_thin_rays=False)
    ]


def _line(packet: bytes) -> _Line | None:
    """Return the line in a datagram, None if it is invalid."""
    if len(packet) < HEADER.size or packet[:4] != MAGIC or packet[4] != VERSION:
        return None
    _, _, looks, bins, number, stamp, carrier, *floats = HEADER.unpack_from(packet)
    baseline, tilt, range_m, azimuth, first, step, altitude, roll, unit = floats
    if len(packet) != HEADER.size + 8 * looks * bins or stamp >= MOST_NS or not np.isfinite(floats).all():
        return None
    if not (0.5 < altitude < 1000 and abs(roll) < 1 and first > 0 and 0 < step <= range_m):
        return None
    if not LEAST_UNIT < unit < MOST_UNIT:
        return None
    try:
        radar = Interferometer(carrier, baseline, tilt, range_m, azimuth, looks)
    except ValueError:
        return None
    parts = np.frombuffer(packet, "<i2", offset=HEADER.size).reshape(looks, 2, bins, 2).astype(np.float32)
    samples = (unit * (parts[..., 0] + 1j * parts[..., 1])).astype(np.complex64)
    clipped = np.asarray((np.abs(parts) >= CLIPPED).any(axis=(0, 1, 3)))
    return _Line(radar, number, stamp, first, step, altitude, roll, samples, clipped)
