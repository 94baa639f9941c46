"""Per-cell sums of a window's heights in integers, for the DSM (SLZ paper, section 3.2.1)."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, ReadOnly1D
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.paper.fuse import TWO_52
from slz.kernels.paper.point_pass import DROPPED, HALF_BITS, LOW16, OUTSIDE
from slz.kernels.raster.bitmap import signed

CHUNK = 64  # points, few enough that a chunk seldom has an exceptional one
ONE, MANTISSA = np.uint64(1), np.uint64((1 << 52) - 1)


@kernel_part
def _place_chunk(
    cells: Array1D[np.uint32],
    heights: Array1D[np.float32],
    least: np.float32,
    most: np.float32,
    shift: float,
    scale: float,
    bits: np.uint64,
    width: np.uint32,
    first: np.uint32,
    places: Array1D[np.uint32],
    scaled: Array1D[np.float64],
    added: Array1D[np.uint64],
) -> bool:
    """Write index and addend of each point of a chunk; return whether some point needs the slow path.

    The loop has no branch, and 32-bit numbers where they suffice, so that the compiler vectorises it. The
    last 52 bits of a number plus 2**52 are that number, rounded: `added` shares the memory of `scaled`.
    """
    odd = np.uint32(0)
    for i in range(np.uint64(len(cells))):
        at, height = cells[i], heights[i]
        beyond = np.uint32(at >= OUTSIDE) | np.uint32(height < least) | np.uint32(height > most)
        odd = np.uint32(odd | beyond)
        places[i] = np.uint32(np.uint32(at >> HALF_BITS) * width) + np.uint32(at & LOW16) - first
        scaled[i] = (float(height) + shift) * scale + TWO_52
    for i in range(np.uint64(len(cells))):
        added[i] = ((added[i] & MANTISSA) << bits) | ONE
    return bool(odd != 0)


@kernel
def sum_heights(
    points: ReadOnly1D[np.float64],
    cells: Array1D[np.uint32],
    heights: Array1D[np.float32],
    level: float,
    low: float,
    high: float,
    scale: float,
    count_bits: int,
    row0: int,
    col0: int,
    width: int,
    sums: Array1D[np.uint64],
) -> int:
    """Add the heights from low to high to the sums of the cells of a box; return how many were accepted.

    A sum holds the number of points in its lowest `count_bits` bits, and above them the sum of their heights
    over `low` in units of 1 / `scale` m. Integers make it independent of the order of the points.

    Parameters
    ----------
    points, cells, heights, level
        As in `point_pass.place_points`. A height so near an end that rounding to float32 may have moved it
        across is looked up in float64.
    sums
        (rows * width,) from (row0, col0) on, added to; rows * width is below 2**32.
    """
    shift, bits, used = level - low, np.uint64(count_bits), 0
    near = (abs(low - level) + abs(high - level)) * 2.0**-22
    least, most = np.float32(low - level + near), np.float32(high - level - near)
    places, scaled = np.empty(CHUNK, np.uint32), np.empty(CHUNK)
    added = scaled.view(np.uint64)
    wide, first = np.uint32(width), np.uint32(row0 * width + col0)
    for start in range(0, len(cells), CHUNK):
        stop = min(start + CHUNK, len(cells))
        some = slice(start, stop)
        if not _place_chunk(
            cells[some], heights[some], least, most, shift, scale, bits, wide, first,
            places, scaled, added,
        ):  # fmt: skip
            for i in range(np.uint64(stop - start)):
                sums[np.uint64(places[i])] += added[i]
            used += stop - start
            continue
        for i in range(start, stop):
            if cells[i] == DROPPED:
                continue
            over = float(heights[i]) + shift
            if heights[i] < least or heights[i] > most:
                z = points[3 * i + 2]
                if z < low or z > high:
                    continue
                over = z - low
            used += 1
            if cells[i] != OUTSIDE:
                k = (signed(cells[i] >> HALF_BITS) - row0) * width + signed(cells[i] & LOW16) - col0
                sums[k] += (np.uint64(signed(np.rint(over * scale))) << bits) | ONE
    return used
