"""Region fill of a contour, and 8-connected flood fill, 64 cells at a time (SLZ paper, Algorithm 1)."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel, kernel_of_source_mode, kernel_part
from slz.kernels.polygons.boundary_tracing import EAST_BIT, WEST_BIT, extent, trace_boundary, westmost
from slz.kernels.raster.bitmap import ALL, LAST, NONE, ONE, Bits, popcount, prefix_xor, signed

TO_WEST, TO_EAST = np.uint64(WEST_BIT), np.uint64(EAST_BIT)


@kernel
def fill(
    path: Array2D[np.int32], edges: Array1D[np.uint8], n: int, row0: int, word0: int, content: Bits
) -> int:
    """Set the cells on and inside a traced contour, in a box of zeros; return their number.

    Parity fill: toggle the bits at western and eastern edges, then take the prefix parity of each row.
    """
    rows, words = content.shape
    for i in range(n):
        r, c = path[i, 0] - row0, path[i, 1] - 64 * word0
        west, east = (edges[i] >> TO_WEST) & ONE, (edges[i] >> TO_EAST) & ONE
        content[r, c >> 6] ^= west << np.uint64(c & 63)
        if (c + 1) >> 6 < words:
            content[r, (c + 1) >> 6] ^= east << np.uint64((c + 1) & 63)
    count = np.uint64(0)
    for r in range(rows):
        inside = NONE
        for w in range(words):
            word = prefix_xor(content[r, w]) ^ inside
            content[r, w] = word
            count += popcount(word)
            inside = ALL if word >> LAST else NONE
    return signed(count)


@kernel_part
def _spread_down(open_cells: np.uint64, set_: np.uint64) -> np.uint64:
    """Spread set cells to lower columns, as far as the free cells reach."""
    for shift in (1, 2, 4, 8, 16, 32):
        set_ |= open_cells & (set_ >> np.uint64(shift))
        open_cells &= open_cells >> np.uint64(shift)
    return set_


@kernel_part
def _spread(open_cells: Bits, part: Bits, r: int, other: int, first: int, last: int) -> tuple[int, int]:
    """Spread a part into row r, from the row itself and from words of an adjacent row.

    Return the first and the last word in which it grew; the first is greater where it did not.
    """
    words = open_cells.shape[1]
    low, high, carry, w = words, -1, NONE, max(0, first - 1)
    while w < words and (w <= last + 1 or carry != NONE):
        free, old = open_cells[r, w], part[r, w]
        new = old
        if free != old:
            near = part[other, w]
            wide = near | (near << ONE) | (near >> ONE) | carry
            if w > 0:
                wide |= part[other, w - 1] >> LAST
            if w < words - 1:
                wide |= part[other, w + 1] << LAST
            new = old | (wide & free)
        if new != old:
            new |= (free ^ (free + new)) & free  # carry to the end of each run of free cells
            if free & ~new & (new >> ONE) != NONE:
                new = _spread_down(free, new)
            part[r, w] = new
            low, high = min(low, w), w
            v = w
            while (
                part[r, v] & ONE != NONE
                and v > 0
                and (open_cells[r, v - 1] & ~part[r, v - 1]) >> LAST != NONE
            ):
                v -= 1
                part[r, v] = _spread_down(open_cells[r, v], part[r, v] | (ONE << LAST))
                low = min(low, v)
        carry = new >> LAST
        w += 1
    return low, high


@kernel_of_source_mode
def component(open_cells: Bits, row: int, col: int) -> Bits:
    """Return the 8-connected component of a set cell.

    Sweeps go up and down. They visit only rows next to one in which the part has grown since, and there only
    the words of that growth, with a margin: each row keeps its first and last such word for either direction.
    """
    rows, words = open_cells.shape
    part = np.zeros(open_cells.shape, np.uint64)
    part[row, col >> 6] = ONE << np.uint64(col & 63)
    south0, south1 = np.full(rows + 2, words), np.full(rows + 2, -1)
    north0, north1 = np.full(rows + 2, words), np.full(rows + 2, -1)
    _spread(open_cells, part, row, row, 0, words)
    south0[row + 2], south1[row + 2] = 0, words - 1
    north0[row], north1[row] = 0, words - 1
    low, high, moved = row, row, True
    while moved:
        moved = False
        for r in range(max(1, low), rows):
            first, last = south0[r + 1], south1[r + 1]
            if last < 0:
                if r > high:
                    break
                continue
            south0[r + 1], south1[r + 1] = words, -1
            first, last = _spread(open_cells, part, r, r - 1, first, last)
            if last >= 0:
                south0[r + 2], south1[r + 2] = min(south0[r + 2], first), max(south1[r + 2], last)
                north0[r], north1[r] = min(north0[r], first), max(north1[r], last)
                high, moved = max(high, r), True
        for r in range(min(rows - 2, high), -1, -1):
            first, last = north0[r + 1], north1[r + 1]
            if last < 0:
                if r < low:
                    break
                continue
            north0[r + 1], north1[r + 1] = words, -1
            first, last = _spread(open_cells, part, r, r + 1, first, last)
            if last >= 0:
                south0[r + 2], south1[r + 2] = min(south0[r + 2], first), max(south1[r + 2], last)
                north0[r], north1[r] = min(north0[r], first), max(north1[r], last)
                low, moved = min(low, r), True
    return part


@kernel_part
def _reaches(
    safe: Bits,
    content: Bits,
    row0: int,
    word0: int,
    row: int,
    col: int,
    path: Array2D[np.int32],
    edges: Array1D[np.uint8],
) -> bool:
    """Return whether a set cell belongs to the component whose contour is around it, see `all_reach`."""
    while True:  # west to an edge; the trace of a hole is followed to its first cell, farther south
        col = westmost(safe, row, col)
        west = col - 1 - 64 * word0
        if west < 0 or (content[row - row0, west >> 6] >> np.uint64(west & 63)) & ONE == NONE:
            return True
        n, area = trace_boundary(safe, row, col, path, edges)
        if n > len(path) or area > 0:
            return False
        first = extent(path, n)[4]
        row, col = signed(path[first, 0]), signed(path[first, 1])


@kernel_of_source_mode
def all_reach(
    safe: Bits, content: Bits, row0: int, word0: int, cells: Array2D[np.int64], longest: int
) -> bool:
    """Return whether set cells inside a contour belong to its component, and not to an island in a hole.

    Also False where the boundary of a hole in between is longer than `longest` cells: then it is undecided.

    Parameters
    ----------
    safe
        The whole map; nothing is set on its margin.
    content
        Cells on and inside the contour, from (row0, 64 word0) on.
    cells
        (n, 2 or more) rows and columns in the content.
    """
    path, edges = np.empty((longest, 2), np.int32), np.empty(longest, np.uint8)
    for i in range(len(cells)):
        row, col = row0 + cells[i, 0], 64 * word0 + cells[i, 1]
        if i > 0 and abs(cells[i, 0] - cells[i - 1, 0]) < 2 and abs(cells[i, 1] - cells[i - 1, 1]) < 2:
            continue  # adjacent to one that belongs to it
        if not _reaches(safe, content, row0, word0, row, col, path, edges):
            return False
    return True
