"""Numba kernel that projects the ranges of Ouster packets to points."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D
from slz.kernels.jit import kernel


@kernel
def place_pixels(
    range_mm: Array3D[np.uint32],
    bright: Array3D[np.uint8],
    number: Array1D[np.int64],
    column_ns: Array1D[np.int64],
    direction: Array3D[np.float32],
    offset_m: Array3D[np.float32],
    every: int,
    absent_before: int,
    xyz_m: Array2D[np.float32],
    stamp_ns: Array1D[np.int64],
    intensity: Array1D[np.uint8],
    ring: Array1D[np.uint8],
    echo: Array1D[np.uint8],
    echoes: Array1D[np.uint8],
    lost: Array2D[np.float32],
    lost_ns: Array1D[np.int64],
) -> tuple[int, int, int]:
    """Project the ranges of columns to points; a range of zero is no return.

    Parameters
    ----------
    range_mm, bright
        (columns, rows, 1 or 2 returns).
    number, column_ns
        (columns,), number in the frame and stamp.
    direction, offset_m
        (columns of a frame, rows, 3); a point is offset + range * direction.
    every, absent_before
        Every k-th ray without a return is kept; number of them in earlier packets.
    xyz_m, stamp_ns, intensity, ring, echo, echoes, lost, lost_ns
        Filled from the front; as in `RawReturns`.

    Returns
    -------
    tuple
        Points, rays without a return, and those of them in `lost`.
    """
    kept, absent, n_lost = 0, 0, 0
    columns, rows, most = range_mm.shape
    for column in range(columns):
        at = number[column]
        for row in range(rows):
            count = 0
            for k in range(most):
                count += range_mm[column, row, k] > 0
            if count == 0:
                x, y, z = direction[at, row, 0], direction[at, row, 1], direction[at, row, 2]
                square = x * x + y * y + z * z
                if (absent_before + absent) % every == 0 and square > 0:
                    unit = np.float32(1 / math.sqrt(square))
                    lost[n_lost, 0], lost[n_lost, 1], lost[n_lost, 2] = x * unit, y * unit, z * unit
                    lost_ns[n_lost] = column_ns[column]
                    n_lost += 1
                absent += 1
                continue
            for k in range(most):
                mm = range_mm[column, row, k]
                if mm == 0:
                    continue
                range_m = np.float32(mm) * np.float32(1e-3)
                for axis in range(3):
                    xyz_m[kept, axis] = offset_m[at, row, axis] + range_m * direction[at, row, axis]
                stamp_ns[kept] = column_ns[column]
                intensity[kept] = bright[column, row, k]
                ring[kept] = rows - 1 - row
                other = range_mm[column, row, 1 - k] if count == 2 else mm
                # The nearer of two returns is the first, in whatever order the sensor sends them.
                echo[kept] = 2 if mm > other or (count == 2 and mm == other and k == 1) else 1
                echoes[kept] = count
                kept += 1
    return kept, absent, n_lost
