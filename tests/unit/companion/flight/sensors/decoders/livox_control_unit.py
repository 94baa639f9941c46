"""Sensor side of the Mid-360 control protocol: accepts parameters and answers.

Implements "Livox LiDAR Communication Protocol - Mid360" (v1.4.11), Control Command Protocol.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field

PORT = 56100
_HEADER = struct.Struct("<BBHIHBB6sHI")
_SEARCH, _SET, _GET = 0x0000, 0x0100, 0x0101
_DATA_TYPE, _POINT_HOST, _WORK_MODE = 0x0000, 0x0006, 0x001A
_IMU_HOST, _IMU_ENABLED = 0x0007, 0x001C
_LENGTHS = {_DATA_TYPE: 1, 0x0001: 1, 0x0005: 8, _POINT_HOST: 8, _IMU_HOST: 8, _WORK_MODE: 1, _IMU_ENABLED: 1}
_NOT_SUPPORTED, _BAD_LENGTH, _BAD_VALUE = 0x20, 0x21, 0x22


def crc16(data: bytes) -> int:
    """Return CRC-16/CCITT-FALSE."""
    value = 0xFFFF
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ 0x1021 if value & 0x8000 else value << 1) & 0xFFFF
    return value


@dataclass(slots=True)
class ControlUnit:
    """State that commands change.

    sampling: whether points are sent. point_host: their destination, None until set. data_type: 1, 2 or 3.
    imu_enabled, imu_host: the same of inertial samples.
    """

    sampling: bool = False
    point_host: tuple[str, int] | None = None
    imu_enabled: bool = False
    imu_host: tuple[str, int] | None = None
    data_type: int = 1
    serial: bytes = b"SIM0000000360\0\0\0"
    address: str = "127.0.0.1"
    malformed: int = field(default=0)

    def receive(self, frame: bytes) -> bytes | None:
        """Process a datagram; return the answer, None without one."""
        if len(frame) < _HEADER.size:
            self.malformed += 1
            return None
        start, version, length, sequence, command, kind, sender, _, head_sum, data_sum = _HEADER.unpack_from(
            frame
        )
        data = frame[_HEADER.size :]
        if (
            (start, version, length) != (0xAA, 0, len(frame))
            or crc16(frame[:18]) != head_sum
            or (zlib.crc32(data) if data else 0) != data_sum
        ):
            self.malformed += 1
            return None
        if kind != 0 or sender != 0:
            return None
        if command == _SEARCH:
            octets = bytes(int(part) for part in self.address.split("."))
            return _answer(command, sequence, b"\0\x09" + self.serial + octets + struct.pack("<H", PORT))
        if command == _SET:
            return _answer(command, sequence, self._set(data))
        return _answer(command, sequence, bytes([_NOT_SUPPORTED, 0, 0]))

    def _set(self, data: bytes) -> bytes:
        """Set all parameters or none; return code and offending key."""
        if len(data) < 4:
            return struct.pack("<BH", _BAD_LENGTH, 0)
        (count, _), at = struct.unpack_from("<HH", data), 4
        values: dict[int, bytes] = {}
        for _ in range(count):
            if at + 4 > len(data):
                return struct.pack("<BH", _BAD_LENGTH, 0)
            key, length = struct.unpack_from("<HH", data, at)
            value = data[at + 4 : at + 4 + length]
            at += 4 + length
            if key not in _LENGTHS:
                return struct.pack("<BH", _NOT_SUPPORTED, key)
            if len(value) != length or length != _LENGTHS[key]:
                return struct.pack("<BH", _BAD_LENGTH, key)
            values[key] = value
        if values.get(_DATA_TYPE, b"\1")[0] not in (1, 2, 3):
            return struct.pack("<BH", _BAD_VALUE, _DATA_TYPE)
        for key, value in values.items():
            if key == _DATA_TYPE:
                self.data_type = value[0]
            elif key == _POINT_HOST:
                self.point_host = ".".join(map(str, value[:4])), struct.unpack_from("<H", value, 4)[0]
            elif key == _IMU_HOST:
                self.imu_host = ".".join(map(str, value[:4])), struct.unpack_from("<H", value, 4)[0]
            elif key == _IMU_ENABLED:
                self.imu_enabled = value[0] == 1
            elif key == _WORK_MODE:
                self.sampling = value[0] == 1
        return struct.pack("<BH", 0, 0)


def _answer(command: int, sequence: int, data: bytes) -> bytes:
    head = struct.pack("<BBHIHBB6s", 0xAA, 0, _HEADER.size + len(data), sequence, command, 1, 1, bytes(6))
    return head + struct.pack("<HI", crc16(head), zlib.crc32(data) if data else 0) + data
