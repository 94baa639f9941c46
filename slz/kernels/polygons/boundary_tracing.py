"""Moore-neighbour boundary tracing on a bitmap, by a lookup table (SLZ paper, Table 1 and Algorithm 1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.polygons.contour import COL_STEP, ROW_STEP
from slz.kernels.raster.bitmap import LAST, NONE, Bits, bit, leading, signed

NO_STEP, DIRECTION_BITS = 8, 15
WEST_BIT, EAST_BIT, START_BITS, ROW_BITS, COL_BITS = 4, 5, 6, 8, 10  # bit offsets of an entry's fields
SEVEN = np.uint64(7)


def _step_table() -> NDArray[np.int32]:
    """Return the next step of a trace, by (search start - 1) / 2 and by the 3 x 3 neighbourhood.

    Bit 3 (row + 1) + column + 1 of the neighbourhood is the neighbour at (row, column). The low byte of an
    entry holds the direction, flags for a west and an east edge that border on the outside, and where the
    search starts at the next cell, (start - 1) / 2. Above it are the row and column steps to the next cell,
    plus 1, so that the steps need no second lookup.

    A cell reached going north or north-east (start 1) has the outside to its west, one reached going south or
    south-west (start 5) to its east; so has a cell whose neighbour there was tested and is not set. A trace
    meets every edge once.
    """
    table = np.zeros((4, 512), np.int32)
    for index in range(4):
        for cells in range(512):
            start, seen = 2 * index + 1, []
            direction = NO_STEP
            for k in range(8):
                e = (start + k) & 7
                if cells >> int(3 * (ROW_STEP[e] + 1) + COL_STEP[e] + 1) & 1:
                    direction = e
                    break
                seen.append(e)
            entry = direction
            if 0 in seen or start == 1:
                entry |= 1 << WEST_BIT
            if 4 in seen or start == 5:
                entry |= 1 << EAST_BIT
            if direction < NO_STEP:
                then = (direction + 6) & 7 if direction & 1 else (direction + 7) & 7
                entry |= (then - 1) // 2 << START_BITS
                entry |= int(ROW_STEP[direction] + 1) << ROW_BITS | int(COL_STEP[direction] + 1) << COL_BITS
            table[index, cells] = entry
    return table


TABLE = _step_table()


@kernel_part
def _neighbourhood(safe: Bits, row: int, col: int) -> int:
    """Return the 3 x 3 cells around a cell as nine bits; all must be inside the map."""
    k, shift = (col - 1) >> 6, np.uint64((col - 1) & 63)
    if shift <= np.uint64(61):
        south, here, north = safe[row - 1, k] >> shift, safe[row, k] >> shift, safe[row + 1, k] >> shift
    else:
        rest = np.uint64(64) - shift
        south = (safe[row - 1, k] >> shift) | (safe[row - 1, k + 1] << rest)
        here = (safe[row, k] >> shift) | (safe[row, k + 1] << rest)
        north = (safe[row + 1, k] >> shift) | (safe[row + 1, k + 1] << rest)
    return signed((south & SEVEN) | ((here & SEVEN) << np.uint64(3)) | ((north & SEVEN) << np.uint64(6)))


@kernel
def trace_boundary(
    safe: Bits, row: int, col: int, path: Array2D[np.int32], edges: Array1D[np.uint8]
) -> tuple[int, int]:
    """Trace a component's boundary from a cell with no set western neighbour, until its first step repeats.

    Parameters
    ----------
    path, edges
        Receive the cells in order, and the low bytes of their table entries.

    Returns
    -------
    Number of cells, greater than `len(path)` where it is too short; signed area of the traced cracks in
    cells, positive for the outside of a component, negative for a hole.
    """
    r, c, index, n, area, first = row, col, 0, 0, 0, -1
    most = len(path)
    while True:
        entry = signed(TABLE[index, _neighbourhood(safe, r, c)])
        direction = entry & DIRECTION_BITS
        if direction == NO_STEP:
            path[0, 0], path[0, 1], edges[0] = r, c, entry
            return 1, 1
        if r == row and c == col:
            if first < 0:
                first = direction
            elif first == direction:
                return n, area
        if n == most:
            return n + 1, 0
        path[n, 0], path[n, 1], edges[n] = r, c, entry
        n += 1
        area += ((c + 1) & -(entry >> EAST_BIT & 1)) - (c & -(entry >> WEST_BIT & 1))
        # SLZ paper, Eq. (15)
        r += (entry >> ROW_BITS & 3) - 1
        # SLZ paper, Eq. (14)
        c += (entry >> COL_BITS & 3) - 1
        index = entry >> START_BITS & 3


@kernel_part
def extent(path: Array2D[np.int32], n: int) -> tuple[int, int, int, int, int]:
    """Return row0, row1, col0, col1 (half open) of n cells, and the index of the first in raster order."""
    first, least = 0, path[0, 0]
    row1, col0, col1 = path[0, 0], path[0, 1], path[0, 1]
    for i in range(n):
        r, c = path[i, 0], path[i, 1]
        row1, col0, col1 = max(row1, r), min(col0, c), max(col1, c)
        if r <= least and (r < least or c < path[first, 1]):
            first, least = i, r
    return signed(least), signed(row1) + 1, signed(col0), signed(col1) + 1, first


@kernel_part
def westmost(safe: Bits, row: int, col: int) -> int:
    """Return the westernmost column of the run of set cells that holds a cell."""
    while True:
        k, bits = col >> 6, np.uint64(col & 63)
        open_ = ~safe[row, k] << (LAST - bits)
        if open_ != NONE:
            return col - signed(leading(open_)) + 1
        col = 64 * k - 1
        if k == 0 or not bit(safe, row, col):
            return col + 1
