"""Livox Mid-360 control protocol (SDK 2), without I/O: start sampling and set the receiver of points.

A frame is 24 bytes, little endian, and its data: 0xAA, version 0, total length, sequence number, command, 0
request or 1 answer, 0 from the computer or 1 from the sensor, 6 reserved, CRC-16/CCITT-FALSE of the 18 bytes
before it, CRC-32 of the data (0 for none). Parameters are set as pairs of key and value. The answer is a
code, 0 for success, and the key that was refused.
"""

from __future__ import annotations

import binascii
import ipaddress
import logging
import struct
import zlib
from dataclasses import dataclass

log = logging.getLogger(__name__)

PORT = 56100  # the sensor's control port
POINT_PORT = 56300  # source port of its points
SET_PARAMETERS = 0x0100
POINT_FORMAT, POINT_HOST, WORK_MODE = 0x0000, 0x0006, 0x001A
CARTESIAN_32, SAMPLING = 1, 1
REQUEST, ANSWER = 0, 1
RETRY_NS = 1_000_000_000
SILENT_NS = 3_000_000_000

_HEADER = struct.Struct("<BBHIHBB6s")
_SUMS = struct.Struct("<HI")
HEADER_BYTES = _HEADER.size + _SUMS.size


@dataclass(frozen=True, slots=True)
class Frame:
    """Message of the control protocol."""

    command: int
    sequence: int
    kind: int
    data: bytes


def encode(frame: Frame, sender: int = 0) -> bytes:
    """Return the bytes of a message, by default the computer's."""
    length = HEADER_BYTES + len(frame.data)
    header = _HEADER.pack(0xAA, 0, length, frame.sequence, frame.command, frame.kind, sender, bytes(6))
    sums = _SUMS.pack(binascii.crc_hqx(header, 0xFFFF), zlib.crc32(frame.data) if frame.data else 0)
    return header + sums + frame.data


def decode(data: bytes) -> Frame | None:
    """Return the message in a datagram, None if it is invalid."""
    if len(data) < HEADER_BYTES:
        return None
    start, version, length, sequence, command, kind, _, _ = _HEADER.unpack_from(data)
    head_sum, data_sum = _SUMS.unpack_from(data, _HEADER.size)
    body = data[HEADER_BYTES:]
    sound = (
        (start, version, length) == (0xAA, 0, len(data))
        and binascii.crc_hqx(data[: _HEADER.size], 0xFFFF) == head_sum
        and (zlib.crc32(body) if body else 0) == data_sum
    )
    return Frame(command, sequence, kind, body) if sound else None


def parameters(values: dict[int, bytes]) -> bytes:
    """Return the data that sets parameters."""
    pairs = b"".join(struct.pack("<HH", key, len(value)) + value for key, value in values.items())
    return struct.pack("<HH", len(values), 0) + pairs


def host_value(address: str, port: int) -> bytes:
    """Return the value of `POINT_HOST`: destination, and source port of the sensor."""
    return ipaddress.IPv4Address(address).packed + struct.pack("<HH", port, POINT_PORT)


class LivoxControl:
    """Client that requests sampling until the sensor answers, and again when its points stop.

    The sensor may have been power-cycled.

    Parameters
    ----------
    host, port
        This computer's address as seen by the sensor, and the port for points.

    Attributes
    ----------
    refused
        Description of a refused parameter, empty without one.
    """

    def __init__(self, host: str, port: int) -> None:
        self._data = parameters(
            {
                POINT_FORMAT: bytes([CARTESIAN_32]),
                POINT_HOST: host_value(host, port),
                WORK_MODE: bytes([SAMPLING]),
            }
        )
        self._sequence = 0
        self._asked_ns: int | None = None
        self._answered = False
        self.refused = ""

    def due(self, now_ns: int, last_point_ns: int | None) -> bytes | None:
        """Return the request to send now, None without one."""
        silent = last_point_ns is None or now_ns - last_point_ns > SILENT_NS
        if self._answered and not silent:
            return None
        pause_ns = SILENT_NS if self._answered else RETRY_NS
        if self._asked_ns is not None and now_ns - self._asked_ns < pause_ns:
            return None
        self._asked_ns, self._answered = now_ns, False
        self._sequence = (self._sequence + 1) & 0xFFFF
        return encode(Frame(SET_PARAMETERS, self._sequence, REQUEST, self._data))

    def on_datagram(self, data: bytes) -> bool:
        """Process a datagram of the sensor; return whether it answers the last request."""
        frame = decode(data)
        if frame is None or (frame.kind, frame.command, frame.sequence) != (
            ANSWER,
            SET_PARAMETERS,
            self._sequence,
        ):
            return False
        self._answered = True
        code = frame.data[0] if frame.data else 0
        key = int.from_bytes(frame.data[1:3], "little")
        refused = f"the LiDAR refuses parameter {key:#06x} (code {code})" if code else ""
        if refused and refused != self.refused:
            log.warning(refused)
        self.refused = refused
        return True
