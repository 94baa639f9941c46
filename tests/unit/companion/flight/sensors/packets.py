"""Livox packets, built field by field from the protocol document."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable

Point = tuple[int, int, int, int, int]  # three coordinates, reflectivity, tag
FORMATS = {1: "<iiiBB", 2: "<hhhBB", 3: "<IHHBB"}


def points_packet(
    points: Iterable[Point],
    *,
    kind: int = 1,
    stamp_ns: int = 5_000_000_000,
    interval_ns: int = 475_000,
    count: int = 0,
    frame: int = 0,
    crc: int | None = None,
    version: int = 0,
    dots: int | None = None,
) -> bytes:
    """Return a packet; `crc` and `dots` replace the true checksum and number of points."""
    body = [struct.pack(FORMATS.get(kind, "<iiiBB"), *point) for point in points]
    checked = struct.pack("<Q", stamp_ns) + b"".join(body)
    return (
        struct.pack(
            "<BHHHHBBB12s",
            version,
            28 + len(checked),
            interval_ns // 100,
            len(body) if dots is None else dots,
            count,
            frame,
            kind,
            0,
            b"\0" * 12,
        )
        + struct.pack("<I", zlib.crc32(checked) if crc is None else crc)
        + checked
    )


def imu_packet(
    samples: Iterable[tuple[float, ...]] = ((0, 0, 0, 0, 0, 1),),
    *,
    stamp_ns: int = 5_000_000_000,
    interval_ns: int = 0,
    dots: int | None = None,
    crc: int | None = None,
) -> bytes:
    """Return inertial samples: data type 0, entries of six floats (rad/s, g)."""
    body = [struct.pack("<6f", *sample) for sample in samples]
    checked = struct.pack("<Q", stamp_ns) + b"".join(body)
    count = len(body) if dots is None else dots
    return (
        struct.pack("<BHHHHBBB12s", 0, 28 + len(checked), interval_ns // 100, count, 0, 0, 0, 0, b"\0" * 12)
        + struct.pack("<I", zlib.crc32(checked) if crc is None else crc)
        + checked
    )
