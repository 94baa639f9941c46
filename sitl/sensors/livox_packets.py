"""Encoder of Livox Mid-360 data packets.

Implements "Livox LiDAR Communication Protocol - Mid360" (v1.4.11), Point Cloud & IMU Data Protocol.
Everything is little-endian. A packet is a header of 36 bytes and its data:

=============  ======  ====  ==========================================================
field          offset  size  meaning
=============  ======  ====  ==========================================================
version             0     1  0
length              1     2  bytes of the whole packet, from ``version``
time_interval       3     2  last point minus first point, 0.1 us
dot_num             5     2  points in this packet (96; 1 for IMU)
udp_cnt             7     2  packet counter
frame_cnt           9     1  frame counter, not valid in a non-repetitive scan
data_type          10     1  0 IMU, 1 Cartesian 32 bit, 2 Cartesian 16 bit, 3 spherical
time_type          11     1  0 free-running since power-up, 1 (g)PTP, 2 GPS
reserved           12    12  zeros
crc32              24     4  over timestamp and data, the common CRC-32 (zlib)
timestamp          28     8  of the first point, ns
=============  ======  ====  ==========================================================
"""

from __future__ import annotations

import struct
import zlib
from enum import IntEnum
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

POINTS_PER_PACKET = 96
FREE_RUNNING = 0
HEADER = struct.Struct("<BHHHHBBB12sI")
HEAD = np.dtype(
    [
        ("version", "u1"),
        ("length", "<u2"),
        ("time_interval", "<u2"),
        ("dot_num", "<u2"),
        ("udp_cnt", "<u2"),
        ("frame_cnt", "u1"),
        ("data_type", "u1"),
        ("time_type", "u1"),
        ("reserved", "u1", 12),
        ("crc32", "<u4"),
        ("timestamp", "<u8"),
    ]
)
_STAMP = struct.Struct("<Q")
_IMU = struct.Struct("<6f")
HEADER_BYTES = HEADER.size + _STAMP.size

CARTESIAN_32 = np.dtype([("xyz", "<i4", 3), ("reflectivity", "u1"), ("tag", "u1")])
CARTESIAN_16 = np.dtype([("xyz", "<i2", 3), ("reflectivity", "u1"), ("tag", "u1")])
SPHERICAL = np.dtype(
    [("depth", "<u4"), ("theta", "<u2"), ("phi", "<u2"), ("reflectivity", "u1"), ("tag", "u1")]
)


class DataType(IntEnum):
    """Layout of the data of a packet."""

    IMU = 0
    CARTESIAN_32 = 1
    CARTESIAN_16 = 2
    SPHERICAL = 3


def point_data(
    points_m: F64, reflectivity: U8, tag: U8, data_type: DataType = DataType.CARTESIAN_32
) -> NDArray[np.void]:
    """Return points as packets hold them, (n,).

    Parameters
    ----------
    points_m
        (n, 3) in the sensor frame, metres; a row of zeros is a pulse without a return.
    reflectivity, tag
        (n,) u8.
    data_type
        Not ``DataType.IMU``.

    Raises
    ------
    ValueError
        If that is no layout of points.
    """
    if data_type is DataType.CARTESIAN_32:
        data = np.zeros(len(points_m), CARTESIAN_32)
        data["xyz"] = np.rint(points_m * 1000.0)
    elif data_type is DataType.CARTESIAN_16:
        data = np.zeros(len(points_m), CARTESIAN_16)
        data["xyz"] = np.rint(points_m * 100.0)
    elif data_type is DataType.SPHERICAL:
        data = _spherical(points_m)
    else:
        raise ValueError(f"point packet: data_type {data_type!r} is not a point format")
    data["reflectivity"] = reflectivity
    data["tag"] = tag
    return data


def point_packets(
    stamp_ns: I64,
    udp_count: I64,
    frame_count: I64,
    interval_ns: int,
    data_type: DataType,
    data: NDArray[np.void],
) -> list[bytes]:
    """Encode packets of as many points each, see `point_data`; the arrays hold a value for each packet.

    Raises
    ------
    ValueError
        If a value does not fit its header field.
    """
    count = len(stamp_ns)
    dots = len(data) // count
    packets = np.zeros(count, _packet_type(data.dtype, dots))
    packets["data"] = data.reshape(count, dots)
    head, length, interval = packets["head"], packets.itemsize, round(interval_ns / 100)
    if interval > 0xFFFF or length > 0xFFFF:
        raise ValueError(f"packet: {interval_ns} ns or {length} bytes do not fit 16 bits")
    head["length"], head["time_interval"], head["dot_num"] = length, interval, dots
    head["udp_cnt"], head["frame_cnt"] = udp_count & 0xFFFF, frame_count & 0xFF
    head["data_type"], head["time_type"] = int(data_type), FREE_RUNNING
    head["timestamp"] = stamp_ns.astype(np.uint64)
    checked = packets.view(np.uint8).reshape(count, length)[:, HEADER.size :]
    head["crc32"] = [zlib.crc32(octets) for octets in checked]
    whole = packets.tobytes()
    return [whole[k : k + length] for k in range(0, len(whole), length)]


@lru_cache(maxsize=8)
def _packet_type(point: np.dtype[np.void], dots: int) -> np.dtype[np.void]:
    return np.dtype([("head", HEAD), ("data", point, dots)])


def encode_imu(stamp_ns: int, count: int, rate_rad_s: F64, force_g: F64) -> bytes:
    """Encode one IMU packet: angular rate (3,) and specific force (3,) in the sensor frame."""
    checked = _STAMP.pack(stamp_ns % 2**64) + _IMU.pack(*rate_rad_s.tolist(), *force_g.tolist())
    head = (0, HEADER.size + len(checked), 0, 1, count & 0xFFFF, 0, DataType.IMU, FREE_RUNNING, bytes(12))
    return HEADER.pack(*head, zlib.crc32(checked)) + checked


def _spherical(points_m: F64) -> NDArray[np.void]:
    data = np.zeros(len(points_m), SPHERICAL)
    x, y, z = points_m.T
    depth = np.linalg.norm(points_m, axis=1)
    azimuth = np.degrees(np.arctan2(y, x)) % 360.0
    data["depth"] = np.rint(depth * 1000.0)
    data["theta"] = np.where(depth > 0.0, np.rint(np.degrees(np.arctan2(np.hypot(x, y), z)) * 100.0), 0)
    data["phi"] = np.where(depth > 0.0, np.rint(azimuth * 100.0), 0)
    return data
