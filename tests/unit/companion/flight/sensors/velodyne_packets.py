"""Velodyne packets, built field by field from the user manual."""

from __future__ import annotations

import struct
from collections.abc import Callable

SINGLE, DUAL = 0x37, 0x39
VLP16, HI_RES, VLP32C = 0x22, 0x24, 0x28
Measure = Callable[[int, int], tuple[int, int]]
"""Block, place in the block -> distance in the sensor's units, reflectivity."""


def nothing(_block: int, _place: int) -> tuple[int, int]:
    return 0, 0


def velodyne_packet(
    measure: Measure = nothing,
    *,
    stamp_us: int = 5_000_000,
    azimuth: int = 0,
    step: int = 40,
    mode: int = SINGLE,
    model: int = VLP16,
    flag: int = 0xEEFF,
) -> bytes:
    """Return a packet; `azimuth` is the first block's, `step` to the next one's, in 0.01 degrees."""
    out = b""
    for block in range(12):
        turn = block // 2 if mode == DUAL else block
        out += struct.pack("<HH", flag, (azimuth + turn * step) % 36_000)
        out += b"".join(struct.pack("<HB", *measure(block, place)) for place in range(32))
    return out + struct.pack("<IBB", stamp_us, mode, model)


def only(block: int, place: int, distance: int = 5000, reflectivity: int = 77) -> Measure:
    """Return a measurement of one ray alone."""
    return lambda b, p: (distance, reflectivity) if (b, p) == (block, place) else (0, 0)
