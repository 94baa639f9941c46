"""Livox Mid-360 control protocol (SDK 2), without I/O: start sampling and set the receivers of its data.

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
IMU_PORT = 56400  # source port of its inertial samples
SET_PARAMETERS = 0x0100
POINT_FORMAT, POINT_HOST, WORK_MODE = 0x0000, 0x0006, 0x001A
IMU_HOST, IMU_ENABLED = 0x0007, 0x001C
CARTESIAN_32, SAMPLING = 1, 1
REQUEST, ANSWER = 0, 1
RETRY_NS = 1_000_000_000
SILENT_NS = 3_000_000_000
IMU_TRIES = 5

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


def host_value(address: str, port: int, source: int = POINT_PORT) -> bytes:
    """Return the value of `POINT_HOST` or `IMU_HOST`: destination, and source port of the sensor."""
    return ipaddress.IPv4Address(address).packed + struct.pack("<HH", port, source)


class LivoxControl:
    """Client that requests sampling until the sensor answers, and again when its points stop.

    The sensor may have been power-cycled. After each answer it requests the inertial samples, in a message of
    their own and `IMU_TRIES` times at most: a sensor sets all parameters of a message or none, and the points
    do not depend on the samples.

    Parameters
    ----------
    host, port
        This computer's address as seen by the sensor, and the port for points.
    imu_port
        Port for inertial samples; None requests none.

    Attributes
    ----------
    refused
        Description of a refused parameter, empty without one.
    answered
        Whether the newest request but one that is still under way was answered.
    """

    def __init__(self, host: str, port: int, imu_port: int | None = None) -> None:
        self._points = parameters(
            {
                POINT_FORMAT: bytes([CARTESIAN_32]),
                POINT_HOST: host_value(host, port),
                WORK_MODE: bytes([SAMPLING]),
            }
        )
        self._imu = b""
        if imu_port is not None:
            enabled = {IMU_HOST: host_value(host, imu_port, IMU_PORT), IMU_ENABLED: b"\1"}
            self._imu = parameters(enabled)
        self._sent = 0
        self._sequence: int | None = None
        self._asked_ns: int | None = None
        self._answered = self.answered = False
        self._imu_tries_left = 0
        self._imu_asked_ns: int | None = None
        self._imu_sequence: int | None = None
        self.refused = ""

    def due(self, now_ns: int, last_point_ns: int | None) -> bytes | None:
        """Return the request to send now, None without one."""
        silent = last_point_ns is None or now_ns - last_point_ns > SILENT_NS
        if self._answered and not silent:
            return self._imu_due(now_ns)
        pause_ns = SILENT_NS if self._answered else RETRY_NS
        if self._asked_ns is not None and not self._answered and now_ns - self._asked_ns >= RETRY_NS:
            self.answered = False  # the newest request stays unanswered
        if self._asked_ns is not None and now_ns - self._asked_ns < pause_ns:
            return None
        self._asked_ns, self._answered = now_ns, False
        self._sequence = self._next_sequence()
        return encode(Frame(SET_PARAMETERS, self._sequence, REQUEST, self._points))

    def on_datagram(self, data: bytes) -> bool:
        """Process a datagram of the sensor; return whether it answers the last request."""
        frame = decode(data)
        if frame is None or (frame.kind, frame.command) != (ANSWER, SET_PARAMETERS):
            return False
        inertial = frame.sequence == self._imu_sequence
        if inertial:
            self._imu_tries_left = 0
        elif frame.sequence == self._sequence:
            self._answered, self._imu_tries_left = True, IMU_TRIES
            self.answered = True
        else:
            return False
        code = frame.data[0] if frame.data else 0
        key = int.from_bytes(frame.data[1:3], "little")
        refused = f"the LiDAR refuses parameter {key:#06x} (code {code})" if code else ""
        if refused and refused != self.refused:
            log.warning(refused)
        if refused or not inertial:
            self.refused = refused
        return True

    def _imu_due(self, now_ns: int) -> bytes | None:
        """Return the request for inertial samples to send now, None without one."""
        if not self._imu or not self._imu_tries_left:
            return None
        if self._imu_asked_ns is not None and now_ns - self._imu_asked_ns < RETRY_NS:
            return None
        self._imu_asked_ns = now_ns
        self._imu_tries_left -= 1
        self._imu_sequence = self._next_sequence()
        return encode(Frame(SET_PARAMETERS, self._imu_sequence, REQUEST, self._imu))

    def _next_sequence(self) -> int:
        self._sent = (self._sent + 1) & 0xFFFF
        return self._sent
