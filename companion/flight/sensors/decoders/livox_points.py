"""Numba kernel that decodes the bytes of many Livox packets into points."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D
from slz.kernels.jit import kernel, kernel_part

HEADER_BYTES = 36
CENTIDEGREE = math.pi / 18000
# Tag bits 0-1: the return is on the line between two close objects; bits 2-3: rain, fog or dust; bits 4-5:
# other. 0 is high confidence, 1 moderate, 2 low, 3 reserved: the upper bit of a pair means low confidence.
DOUBTFUL = 0b101010
LINES = 4


Bytes = ReadOnly1D[np.uint8]


@kernel_part
def _u16(data: Bytes, at: np.uint64) -> np.uint32:
    return np.uint32(data[at]) | np.uint32(data[at + np.uint64(1)]) << np.uint32(8)


@kernel_part
def _u32(data: Bytes, at: np.uint64) -> np.uint32:
    return _u16(data, at) | _u16(data, at + np.uint64(2)) << np.uint32(16)


@kernel_part
def _i32(data: Bytes, at: np.uint64) -> np.int32:
    return np.int32(_u32(data, at))


@kernel_part
def _i16(data: Bytes, at: np.uint64) -> np.int16:
    return np.int16(_u16(data, at))


@kernel_part
def _metres(data: Bytes, at: np.uint64, kind: int) -> tuple[float, float, float]:
    """Return x, y, z of the point at a byte offset; kind 1: mm, 2: cm, 3: depth in mm and two angles."""
    two, four, six, eight = np.uint64(2), np.uint64(4), np.uint64(6), np.uint64(8)
    if kind == 1:
        return _i32(data, at) * 1e-3, _i32(data, at + four) * 1e-3, _i32(data, at + eight) * 1e-3
    if kind == 2:
        return _i16(data, at) * 1e-2, _i16(data, at + two) * 1e-2, _i16(data, at + four) * 1e-2
    depth = _u32(data, at) * 1e-3
    theta = _u16(data, at + four) * CENTIDEGREE  # from the z axis
    phi = _u16(data, at + six) * CENTIDEGREE  # from x towards y
    across = depth * math.sin(theta)
    return across * math.cos(phi), across * math.sin(phi), depth * math.cos(theta)


@kernel_part
def _direction(data: Bytes, at: np.uint64, kind: int) -> tuple[float, float, float]:
    """Return the unit vector of a ray without a return, NaN where its angles are not given."""
    theta, phi = _u16(data, at + np.uint64(4)), _u16(data, at + np.uint64(6))
    if kind != 3 or (theta == 0 and phi == 0):
        return math.nan, math.nan, math.nan
    across = math.sin(theta * CENTIDEGREE)
    return (
        across * math.cos(phi * CENTIDEGREE),
        across * math.sin(phi * CENTIDEGREE),
        math.cos(theta * CENTIDEGREE),
    )


@kernel
def decode_points(
    data: ReadOnly1D[np.uint8],
    xyz_m: Array2D[np.float32],
    stamps_ns: Array1D[np.int64],
    intensity: Array1D[np.uint8],
    ring: Array1D[np.uint8],
    every: int,
    absent_before: int,
    lost: Array2D[np.float32],
    lost_ns: Array1D[np.int64],
    lost_ring: Array1D[np.uint8],
) -> tuple[int, int, int, int]:
    """Decode consecutive packets in `data`.

    Every point is written after the last one kept and overwritten by the next one unless it is kept too,
    because a branch per point would be unpredictable.

    Parameters
    ----------
    data
        (bytes,) uint8, whole packets, checked.
    xyz_m, stamps_ns, intensity, ring
        Filled from the front: (points, 3) m, (points,) ns, (points,), (points,) laser line.
    every, absent_before
        Every k-th point without a return is kept in `lost`; number of them in earlier packets.
    lost, lost_ns, lost_ring
        Filled from the front: directions, NaN where a packet does not give them, stamps and laser lines.

    Returns
    -------
    tuple
        Points kept, points without a return, points of low confidence, rays in `lost`.
    """
    one, two = np.uint64(1), np.uint64(2)  # unsigned: no negative indexing
    kept, absent, doubtful, n_lost = 0, 0, 0, 0
    packet, end = np.uint64(0), np.uint64(len(data))
    while packet < end:
        interval = 100 * int(_u16(data, packet + np.uint64(3)))
        count = int(_u16(data, packet + np.uint64(5)))
        kind = int(data[packet + np.uint64(10)])
        stamp = np.int64(_u32(data, packet + np.uint64(28)))
        stamp |= np.int64(_u32(data, packet + np.uint64(32))) << 32
        size = np.uint64(14 if kind == 1 else 8 if kind == 2 else 10)
        step = interval / max(1, count - 1)
        at = packet + np.uint64(HEADER_BYTES)
        packet = at + size * np.uint64(count)
        for i in range(count):
            x, y, z = _metres(data, at, kind)
            tag = data[at + size - one]
            xyz_m[kept, 0], xyz_m[kept, 1], xyz_m[kept, 2] = x, y, z
            stamps_ns[kept] = stamp + np.int64(i * step)
            intensity[kept] = data[at + size - two]
            ring[kept] = i % LINES
            nothing = x == 0 and y == 0 and z == 0
            unsure = not nothing and tag & DOUBTFUL != 0
            if nothing:
                if (absent_before + absent) % every == 0:
                    lost[n_lost, 0], lost[n_lost, 1], lost[n_lost, 2] = _direction(data, at, kind)
                    lost_ns[n_lost], lost_ring[n_lost] = stamps_ns[kept], ring[kept]
                    n_lost += 1
                absent += 1
            doubtful += unsure
            kept += not (nothing or unsure)
            at += size
    return kept, absent, doubtful, n_lost
