"""Encoder of Velodyne VLP-16 data packets (user manual 63-9243, section 9).

Everything is little-endian. A packet of 1206 bytes is 12 blocks of 100 bytes, a stamp and two factory bytes:

==========  ======  ====  ===============================================================
field       offset  size  meaning
==========  ======  ====  ===============================================================
flag             0     2  of each block: 0xEEFF (the bytes FF EE)
azimuth          2     2  of the block's first laser, 0.01 degree, 0 to 35999
channels         4    96  32 times distance (2 bytes, 2 mm) and reflectivity (1 byte)
stamp         1200     4  first firing of the packet, microseconds past the hour
mode          1204     1  0x37 strongest, 0x38 last, 0x39 dual
model         1205     1  0x22 VLP-16
==========  ======  ====  ===============================================================

In single mode a block holds two firing sequences of 16 lasers. In dual mode two blocks of one azimuth follow
each other, first the last returns, then the strongest, or the second strongest where both are the same.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

LASERS, BLOCKS, CHANNELS = 16, 12, 32
DISTANCE_M = 0.002
MOST_DISTANCE = 0xFFFF
HOUR_US = 3_600_000_000
MODEL = 0x22
PACKET = np.dtype(
    [
        (
            "blocks",
            [
                ("flag", "<u2"),
                ("azimuth", "<u2"),
                ("channels", [("distance", "<u2"), ("reflectivity", "u1")], CHANNELS),
            ],
            BLOCKS,
        ),
        ("stamp", "<u4"),
        ("mode", "u1"),
        ("model", "u1"),
    ]
)


class ReturnMode(IntEnum):
    """Selection of the returns of a ray that are sent."""

    STRONGEST = 0x37
    LAST = 0x38
    DUAL = 0x39


def encode_packets(
    stamp_ns: I64, azimuth_deg: F64, range_m: F64, reflectivity: U8, mode: ReturnMode = ReturnMode.STRONGEST
) -> list[bytes]:
    """Encode n packets.

    Parameters
    ----------
    stamp_ns
        (n,) time of the first firing on any clock; only the time past the hour is sent.
    azimuth_deg
        (n, 12) of each block's first laser.
    range_m, reflectivity
        (n, 12, 32), zero is no return.
    """
    packets = np.zeros(len(stamp_ns), PACKET)
    packets["blocks"]["flag"] = 0xEEFF
    packets["blocks"]["azimuth"] = np.rint(azimuth_deg * 100.0).astype(np.int64) % 36_000
    distance = np.maximum(np.rint(range_m / DISTANCE_M), 0)
    packets["blocks"]["channels"]["distance"] = np.where(distance > MOST_DISTANCE, 0, distance)
    packets["blocks"]["channels"]["reflectivity"] = np.where(distance > 0, reflectivity, 0)
    packets["stamp"] = stamp_ns // 1000 % HOUR_US
    packets["mode"], packets["model"] = int(mode), MODEL
    return [packet.tobytes() for packet in packets]
