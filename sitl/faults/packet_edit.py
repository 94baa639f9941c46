"""Changes to a LiDAR's finished packets: ranges of rays, stamps and numbers, with valid checksums."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sitl.sensors import livox_packets as livox
from sitl.sensors import ouster_packets as ouster
from sitl.sensors import velodyne_packets as velodyne
from sitl.sensors.ouster_os1 import COLUMNS
from sitl.sensors.vlp16 import ELEVATION_DEG

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Flags = NDArray[np.bool_]
Rays = Callable[[F64, I64], Flags]
"""Azimuth (degrees, counter-clockwise from the x axis, NaN unknown) and line of rays -> which of them."""

VELODYNE_BYTES = velodyne.PACKET.itemsize
OUSTER_ENDS = 64  # bytes of header and footer
PACKETS_OF_FRAME = COLUMNS // ouster.PACKET_COLUMNS
_STAMP = struct.Struct("<Q")
_CRC = struct.Struct("<I")
_TIME_TYPE_AT = 11
_LIVOX_LINES = 4


def maker_of(packet: bytes) -> str:
    """Return 'livox', 'velodyne' or 'ouster'."""
    if len(packet) == VELODYNE_BYTES:
        return "velodyne"
    is_livox = packet[0] == 0 and int.from_bytes(packet[1:3], "little") == len(packet)
    return "livox" if is_livox else "ouster"


def with_ranges(packet: bytes, which: Rays, range_m: float) -> bytes:
    """Return a packet in which the chosen rays measure a range, 0 for no return."""
    match maker_of(packet):
        case "livox":
            return _livox_ranges(packet, which, range_m)
        case "velodyne":
            return _velodyne_ranges(packet, which, range_m)
    return _ouster_ranges(packet, which, range_m)


def azimuth_deg(packet: bytes) -> float:
    """Return the azimuth of the packet's first ray, NaN where it has no return (Livox)."""
    match maker_of(packet):
        case "livox":
            x, y, _ = np.frombuffer(packet, livox.CARTESIAN_32, 1, livox.HEADER_BYTES)["xyz"][0].tolist()
            return float(np.degrees(np.arctan2(y, x)) % 360) if x or y else float("nan")
        case "velodyne":
            return -int.from_bytes(packet[2:4], "little") / 100.0 % 360
    first = int(_ouster(packet)["columns"]["measurement_id"][0])
    return (180.0 - first * 360.0 / COLUMNS) % 360


def restamped(packet: bytes, later_ns: Callable[[int], int]) -> bytes:
    """Return a packet whose stamps, on the sensor's clock, are replaced by a function of themselves."""
    match maker_of(packet):
        case "livox":
            (stamp,) = _STAMP.unpack_from(packet, livox.HEADER.size)
            changed = bytearray(packet)
            _STAMP.pack_into(changed, livox.HEADER.size, later_ns(stamp))
            return _sealed(changed)
        case "velodyne":
            one = np.frombuffer(packet, velodyne.PACKET).copy()
            one["stamp"] = later_ns(int(one["stamp"][0]) * 1000) // 1000 % velodyne.HOUR_US
            return one.tobytes()
    columns = _ouster(packet).copy()
    stamps = columns["columns"]["timestamp"]
    stamps[...] = stamps.astype(np.int64) + (later_ns(int(stamps[0])) - int(stamps[0]))
    return columns.tobytes()


def numbered(packet: bytes, number: int) -> bytes:
    """Return a packet with another number in the sequence; a Velodyne's have none."""
    match maker_of(packet):
        case "livox":
            changed = bytearray(packet)
            struct.pack_into("<H", changed, 7, number & 0xFFFF)
            return bytes(changed)
        case "velodyne":
            return packet
    changed_columns = _ouster(packet).copy()
    frame, place = divmod(number, PACKETS_OF_FRAME)
    changed_columns["frame_id"] = frame % 65_536
    first = place * ouster.PACKET_COLUMNS
    changed_columns["columns"]["measurement_id"] = first + np.arange(ouster.PACKET_COLUMNS)
    return changed_columns.tobytes()


def number_of(packet: bytes) -> int:
    """Return a packet's number in the sequence, 0 for a Velodyne's."""
    match maker_of(packet):
        case "livox":
            return int.from_bytes(packet[7:9], "little")
        case "velodyne":
            return 0
    one = _ouster(packet)
    first = int(one["columns"]["measurement_id"][0])
    return int(one["frame_id"]) * PACKETS_OF_FRAME + first // ouster.PACKET_COLUMNS


def with_time_type(packet: bytes, time_type: int) -> bytes:
    """Return a Livox packet that names another source of its stamps."""
    changed = bytearray(packet)
    changed[_TIME_TYPE_AT] = time_type
    return bytes(changed)


def without_columns(packet: bytes) -> bytes:
    """Return an Ouster packet whose columns are all marked as not measured."""
    one = _ouster(packet).copy()
    one["columns"]["status"] = 0
    return one.tobytes()


def _livox_ranges(packet: bytes, which: Rays, range_m: float) -> bytes:
    points = np.frombuffer(packet[livox.HEADER_BYTES :], livox.CARTESIAN_32).copy()
    xyz = points["xyz"].astype(np.float64)
    length = np.linalg.norm(xyz, axis=1)
    azimuth = np.where(length > 0, np.degrees(np.arctan2(xyz[:, 1], xyz[:, 0])) % 360, np.nan)
    hit = which(azimuth, np.arange(len(points)) % _LIVOX_LINES) & (length > 0)
    points["xyz"][hit] = np.rint(xyz[hit] * (range_m * 1000.0 / length[hit])[:, np.newaxis])
    points["reflectivity"][hit] = 3 if range_m else 0
    return _sealed(bytearray(packet[: livox.HEADER_BYTES] + points.tobytes()))


def _velodyne_ranges(packet: bytes, which: Rays, range_m: float) -> bytes:
    one = np.frombuffer(packet, velodyne.PACKET).copy()
    blocks = one["blocks"][0]
    azimuth = np.repeat(-blocks["azimuth"].astype(np.float64) / 100.0 % 360, velodyne.CHANNELS)
    line = np.argsort(np.argsort(ELEVATION_DEG))[np.arange(velodyne.CHANNELS) % velodyne.LASERS]
    hit = which(azimuth, np.tile(line, velodyne.BLOCKS)).reshape(velodyne.BLOCKS, velodyne.CHANNELS)
    blocks["channels"]["distance"][hit] = round(range_m / velodyne.DISTANCE_M)
    blocks["channels"]["reflectivity"][hit] = 3 if range_m else 0
    return one.tobytes()


def _ouster_ranges(packet: bytes, which: Rays, range_m: float) -> bytes:
    one = _ouster(packet).copy()
    columns = one["columns"]
    rows = columns["pixels"].shape[1]
    azimuth = (180.0 - columns["measurement_id"].astype(np.float64) * 360.0 / COLUMNS) % 360
    line = np.tile(rows - 1 - np.arange(rows), ouster.PACKET_COLUMNS)
    hit = which(np.repeat(azimuth, rows), line).reshape(ouster.PACKET_COLUMNS, rows)
    columns["pixels"]["range"][hit] = round(range_m * 1000.0)
    columns["pixels"]["reflectivity"][hit] = 3 if range_m else 0
    return one.tobytes()


@lru_cache(maxsize=8)
def _layout(size: int) -> np.dtype[np.void]:
    words = (size - OUSTER_ENDS) // (12 * ouster.PACKET_COLUMNS)  # of 12 bytes in a column: header and pixels
    return ouster.packet_type(words - 1)


def _ouster(packet: bytes) -> np.ndarray[tuple[()], np.dtype[np.void]]:
    return np.frombuffer(packet, _layout(len(packet))).reshape(())


def _sealed(packet: bytearray) -> bytes:
    _CRC.pack_into(packet, livox.HEADER.size - 4, zlib.crc32(memoryview(packet)[livox.HEADER.size :]))
    return bytes(packet)
