"""Boundaries of cells: tracing, collinear points, and rings of edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.argument_types import Array1D, Array2D, Strided2D
from slz.kernels.array_memory import doubled
from slz.kernels.jit import kernel, kernel_at_call, kernel_part
from slz.kernels.raster.bitmap import LAST, NONE, Bits, bit, leading, signed

# Moore neighbours, clockwise from west (SLZ paper, Table 1); rows grow to the north.
COL_STEP = np.array([-1, -1, 0, 1, 1, 1, 0, -1], np.int64)
ROW_STEP = np.array([0, -1, -1, -1, 0, 1, 1, 1], np.int64)
# Directions of travel: east, north, west, south; offset from the vertex behind to the cell on the left.
ROW_AHEAD = np.array([0, 1, 0, -1], np.int64)
COL_AHEAD = np.array([1, 0, -1, 0], np.int64)
ROW_LEFT = np.array([0, 0, -1, -1], np.int64)
COL_LEFT = np.array([0, -1, -1, 0], np.int64)
NO_STEP, DIRECTION_BITS = 8, 15
WEST_BIT, EAST_BIT, START_BITS, ROW_BITS, COL_BITS = 4, 5, 6, 8, 10  # bit offsets of an entry's fields
SEVEN = np.uint64(7)


@kernel_at_call
def squares(safe: Strided2D[np.uint8]) -> Strided2D[np.int32]:
    """Return, by cell, the side in cells of the largest safe square whose last row and column end there."""
    rows, cols = safe.shape
    side = np.zeros((rows, cols), np.int32)
    for r in range(rows):
        for c in range(cols):
            if safe[r, c]:
                if r == 0 or c == 0:
                    side[r, c] = 1
                else:
                    side[r, c] = 1 + min(side[r - 1, c], side[r, c - 1], side[r - 1, c - 1])
    return side


@kernel
def corner_indices(boundary: Array2D[np.int32]) -> Array1D[np.int32]:
    """Return the indices of the boundary cells that `slz.zones.polygonise.without_collinear` keeps."""
    n, m = len(boundary), 0
    kept = np.empty(n, np.int32)
    for i in range(n):
        before, after = i - 1 if i > 0 else n - 1, i + 1 if i + 1 < n else 0
        r, c = boundary[i, 0], boundary[i, 1]
        r0, c0, r1, c1 = boundary[before, 0], boundary[before, 1], boundary[after, 0], boundary[after, 1]
        flat = (r0 == r and r1 == r) or (c0 == c and c1 == c)
        turns = (r - r0) * (r1 - r) + (c - c0) * (c1 - c) < 0  # the tip of a spur
        kept[m] = i
        m += not flat or turns or n == 1
    return kept[:m].copy()


@kernel_part
def _cell(cells: Strided2D[np.uint8], row: int, col: int) -> bool:
    if row < 0 or col < 0 or row >= cells.shape[0] or col >= cells.shape[1]:
        return False
    return bool(cells[row, col] != 0)


@kernel
def boundary_rings(cells: Strided2D[np.uint8]) -> Strided2D[np.int32]:
    """Return every ring around the set cells as (n, 3): ring number, row and column of unit-step vertices.

    Set cells are to the left: outer rings run anticlockwise (rows grow to the north), holes clockwise. Where
    two cells touch at a corner only, a ring keeps to its own cell, so that no ring crosses another or itself.
    """
    rows, cols = cells.shape
    done = np.zeros((rows + 1, cols + 1), np.uint8)  # bit 1: the edge leaving east from here, bit 2: west
    out = np.empty((1024, 3), np.int32)
    n, ring = 0, 0
    for r0 in range(rows + 1):
        for c0 in range(cols):
            above, below = _cell(cells, r0, c0), _cell(cells, r0 - 1, c0)
            if above == below:
                continue
            # Above set: travel east with it on the left. Below set: travel west, from the vertex to the east.
            direction = 0 if above else 2
            r, c = r0, c0 if above else c0 + 1
            bit = np.uint8(1 if above else 2)
            if done[r, c] & bit:
                continue
            while True:
                if direction == 0 or direction == 2:
                    mark = np.uint8(1 if direction == 0 else 2)
                    if done[r, c] & mark:
                        break
                    done[r, c] |= mark
                if n == len(out):
                    out = doubled(out)
                out[n, 0], out[n, 1], out[n, 2] = ring, r, c
                n += 1
                r, c = r + ROW_AHEAD[direction], c + COL_AHEAD[direction]
                for turn in (1, 0, 3):  # left first, so that diagonal neighbours stay apart
                    way = (direction + turn) & 3
                    left = _cell(cells, r + ROW_LEFT[way], c + COL_LEFT[way])
                    right_way = (way + 3) & 3
                    right = _cell(cells, r + ROW_LEFT[right_way], c + COL_LEFT[right_way])
                    if left and not right:
                        direction = way
                        break
            ring += 1
    return out[:n].copy()


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
