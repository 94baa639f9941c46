"""LightWare binary serial protocol of the scanning SF45/B and related rangefinders, without I/O.

A frame is 0xAA, flags (16 bits, little endian: length of the payload times 64, plus 1 for a write), the
payload, whose first byte is the command, and CRC-16/XMODEM of all preceding bytes. Distances stream as
command 44: 16 bits each, the first return in centimetres and, from a scanner, the angle in hundredths of a
degree, clockwise from ahead seen from above.
"""

from __future__ import annotations

import binascii
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

START = 0xAA
DISTANCE_OUTPUT, STREAM, DISTANCES_CM, UPDATE_RATE, SCAN_ENABLE = 27, 30, 44, 66, 96
FIRST_RETURN, ANGLE = 1 << 0, 1 << 8
STREAM_DISTANCES_CM = 5
FASTEST = 12
MOST_PAYLOAD = 64  # no requested answer is longer
LOST_CM = (-100, 0)  # values sent for no return


@dataclass(slots=True)
class LightwareCounters:
    """Counters of received and dropped data."""

    packets: int = 0
    other: int = 0
    malformed: int = 0
    bad_checksum: int = 0
    returns: int = 0
    no_return: int = 0


def encode(command: int, data: bytes, write: bool = True) -> bytes:
    """Return the frame of a command."""
    payload = bytes([command]) + data
    head = struct.pack("<BH", START, len(payload) << 6 | write)
    return head + payload + struct.pack("<H", binascii.crc_hqx(head + payload, 0))


def requests() -> tuple[bytes, ...]:
    """Return the requests for scanning and for streaming first returns with angles at the highest rate."""
    return (
        encode(UPDATE_RATE, bytes([FASTEST])),
        encode(DISTANCE_OUTPUT, struct.pack("<I", FIRST_RETURN | ANGLE)),
        encode(SCAN_ENABLE, b"\1"),
        encode(STREAM, struct.pack("<I", STREAM_DISTANCES_CM)),
    )


@dataclass(slots=True)
class LightwareDecoder:
    """Decoder of frames in a byte stream; other bytes are counted and skipped."""

    counters: LightwareCounters = field(default_factory=LightwareCounters)
    _bytes: bytearray = field(default_factory=bytearray)

    def feed(self, data: bytes) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Return the points (n, 3) that these bytes complete, m, forward, left, up of the sensor.

        With each point comes its index (n,) among the completed readings, because some have no return.
        """
        self._bytes += data
        before = self.counters.packets
        found = [
            (point, self.counters.packets - before - 1)
            for payload in self._payloads()
            if (point := self._point(payload)) is not None
        ]
        points = np.array([point for point, _ in found], np.float32).reshape(-1, 3)
        return points, np.array([number for _, number in found], np.int64)

    def _payloads(self) -> Iterator[bytes]:
        waiting = self._bytes
        while True:
            start = waiting.find(START)
            self.counters.malformed += (len(waiting) if start < 0 else start) > 0
            del waiting[: len(waiting) if start < 0 else start]
            if len(waiting) < 3:
                return
            length = (waiting[1] | waiting[2] << 8) >> 6
            if not 0 < length <= MOST_PAYLOAD or waiting[1] & 0x3E:
                self._skip("malformed")
                continue
            whole = 3 + length + 2
            if len(waiting) < whole:
                return
            if (
                binascii.crc_hqx(bytes(waiting[: whole - 2]), 0)
                != waiting[whole - 2] | waiting[whole - 1] << 8
            ):
                self._skip("bad_checksum")
                continue
            payload = bytes(waiting[3 : 3 + length])
            del waiting[:whole]
            yield payload

    def _skip(self, why: str) -> None:
        """Skip a false start byte."""
        setattr(self.counters, why, getattr(self.counters, why) + 1)
        del self._bytes[0]

    def _point(self, payload: bytes) -> tuple[float, float, float] | None:
        c = self.counters
        if payload[0] != DISTANCES_CM or len(payload) not in (3, 5):
            c.other += 1
            return None
        c.packets += 1
        (distance_cm,) = struct.unpack_from("<h", payload, 1)
        angle_deg = struct.unpack_from("<h", payload, 3)[0] / 100 if len(payload) == 5 else 0.0
        if distance_cm in LOST_CM or distance_cm < 0:
            c.no_return += 1
            return None
        c.returns += 1
        angle, distance_m = np.radians(angle_deg), distance_cm / 100
        return distance_m * float(np.cos(angle)), -distance_m * float(np.sin(angle)), 0.0
