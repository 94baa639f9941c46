"""Livox packets, decoded with a plain struct reader, field by field from the protocol document."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np
import pytest

from sitl.sensors.livox_packets import DataType, point_data, point_packets

STAMP_NS = 123_456_789_012_345
POINTS = np.array([[1.2345, -2.3456, 3.4567], [0.0, 0.0, 0.0], [-40.0, 0.001, -0.001]])
REFLECTIVITY = np.array([17, 0, 255], np.uint8)
TAG = np.array([0, 0, 16], np.uint8)


def encode_points(
    *points: Any,
    data_type: DataType = DataType.CARTESIAN_32,
    counters: Any = (70_000, 300),
    ns: int = 475_000,
) -> bytes:
    """Return the second of two packets of the same points."""
    data = np.tile(point_data(*points, data_type), 2)
    labels = [np.array([0, value]) for value in (STAMP_NS, *counters)]
    return point_packets(*labels, ns, data_type, data)[1]


def test_header_has_every_field_at_its_offset() -> None:
    packet = encode_points(POINTS, REFLECTIVITY, TAG)
    assert packet[0] == 0
    assert struct.unpack_from("<H", packet, 1) == (len(packet),) == (36 + 3 * 14,)
    assert struct.unpack_from("<H", packet, 3) == (4750,)
    assert struct.unpack_from("<H", packet, 5) == (3,)
    assert struct.unpack_from("<H", packet, 7) == (70_000 % 65_536,)
    assert packet[9:12] == bytes([300 % 256, 1, 0])
    assert packet[12:24] == bytes(12)
    assert struct.unpack_from("<Q", packet, 28) == (123_456_789_012_345,)


def test_crc_covers_timestamp_and_data_and_nothing_else() -> None:
    packet = encode_points(POINTS, REFLECTIVITY, TAG)
    assert struct.unpack_from("<I", packet, 24) == (zlib.crc32(packet[28:]),)
    other = encode_points(POINTS, REFLECTIVITY, TAG, counters=(1, 2), ns=0)
    assert other[24:28] == packet[24:28]


def test_cartesian_32_is_millimetres() -> None:
    packet = encode_points(POINTS, REFLECTIVITY, TAG)
    records = [struct.unpack_from("<iiiBB", packet, 36 + 14 * k) for k in range(3)]
    assert records == [(1234, -2346, 3457, 17, 0), (0, 0, 0, 0, 0), (-40000, 1, -1, 255, 16)]


def test_cartesian_16_is_centimetres() -> None:
    packet = encode_points(POINTS, REFLECTIVITY, TAG, data_type=DataType.CARTESIAN_16)
    assert packet[10] == 2
    records = [struct.unpack_from("<hhhBB", packet, 36 + 8 * k) for k in range(3)]
    assert records == [(123, -235, 346, 17, 0), (0, 0, 0, 0, 0), (-4000, 0, 0, 255, 16)]


def test_spherical_is_depth_zenith_and_azimuth() -> None:
    points = np.array([[0.0, 2.0, 0.0], [-3.0, 0.0, 3.0], [1.0, -1.0, 0.0], [0.0, 0.0, 0.0]])
    packet = encode_points(points, np.zeros(4, np.uint8), np.zeros(4, np.uint8), data_type=DataType.SPHERICAL)
    assert packet[10] == 3
    records = [struct.unpack_from("<IHHBB", packet, 36 + 10 * k) for k in range(4)]
    assert [r[:3] for r in records] == [
        (2000, 9000, 9000),
        (4243, 4500, 18000),
        (1414, 9000, 31500),
        (0, 0, 0),
    ]


def test_what_does_not_fit_the_fields_is_refused() -> None:
    with pytest.raises(ValueError, match="do not fit 16 bits"):
        encode_points(POINTS, REFLECTIVITY, TAG, ns=7_000_000)
    with pytest.raises(ValueError, match="not a point format"):
        encode_points(POINTS, REFLECTIVITY, TAG, data_type=DataType.IMU)
