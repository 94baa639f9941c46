"""Largest inscribed square of a bitmap, and its maximum of the Euclidean distance transform."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D, Strided2D
from slz.kernels.array_memory import doubled
from slz.kernels.jit import kernel, kernel_of_source_mode, kernel_part
from slz.kernels.raster.bitmap import ALL, LAST, NONE, ONE, Bits, leading, lowest, signed, word_at
from slz.kernels.raster.morphology import erode_columns, erode_rows, erode_to_side

NEAR = 32  # columns to either side that one word around a cell covers
WITNESSES = 16  # recent nearest outside cells, kept for distance bounds
MIDDLE, NEAR_BITS = np.uint64(NEAR - 1), np.uint64(NEAR)


@kernel_part
def _largest(corners: Bits, side: int) -> tuple[int, tuple[int, int]]:
    """Return the side and the first south-west corner of the largest square, see `largest_square`."""
    best, step, grows = corners, side, True
    while step > 0:
        larger = best.copy()
        erode_columns(larger, step)
        erode_rows(larger, step)
        if larger.any():
            best, side = larger, side + step
            step = side if grows else step
        else:
            grows, step = False, step >> 1
    row = w = 0
    while best[row, w] == NONE:
        row, w = (row, w + 1) if w + 1 < best.shape[1] else (row + 1, 0)
    return side, (row, 64 * w + signed(lowest(best[row, w])))


@kernel
def largest_square(corners: Bits, side: int) -> int:
    """Return the side of the largest square of set cells.

    Parameters
    ----------
    corners
        South-west corners of the squares of this side; at least one.
    """
    return _largest(corners, side)[0]


@kernel_part
def _row_distance(part: Bits, r: int, col: int, most2: int) -> int:
    """Return the distance along a row to the nearest open cell, or one whose square is at least `most2`."""
    first, bits, words = col >> 6, np.uint64(col & 63), part.shape[1]
    if first < 0 or first >= words:
        return 0
    best = int(np.ceil(np.sqrt(float(most2))))
    open_, dx, w = ~part[r, first] >> bits, 0, first
    while open_ == NONE and dx < best:
        w += 1
        dx = 64 * w - col
        open_ = ~part[r, w] if w < words else ONE
    best = min(best, dx + signed(lowest(open_)))
    open_, dx, w = ~part[r, first] << (LAST - bits), 0, first
    while open_ == NONE and dx < best:
        dx = col + 1 - 64 * w
        w -= 1
        open_ = ~part[r, w] if w >= 0 else ONE << LAST
    return int(min(best, dx + signed(leading(open_))))


@kernel_part
def _is_open(part: Bits, row: int, col: int) -> bool:
    if row < 0 or row >= part.shape[0] or col < 0 or col >= 64 * part.shape[1]:
        return True
    return bool((part[row, col >> 6] >> np.uint64(col & 63)) & ONE == NONE)


@kernel_part
def _distance2(part: Bits, row: int, col: int, least2: int, most2: int) -> tuple[int, int, int]:
    """Return the squared distance from a cell to the nearest outside cell; if below `least2`, any such value.

    Then row and column of that outside cell, undefined where the distance is `most2`.
    """
    best, beside, dy = most2, 0, 0
    where = row
    while dy * dy < best and best >= least2:
        for r in (row - dy, row + dy):
            if best <= NEAR * NEAR:  # one word holds all cells that matter
                open_ = ~word_at(part, r, col - 31)
                dx = signed(min(lowest(open_ >> MIDDLE), leading(open_ << NEAR_BITS)))
            elif r < 0 or r >= len(part):
                dx = 0
            else:
                dx = _row_distance(part, r, col, best - dy * dy)
            if dy * dy + dx * dx < best:
                best, where, beside = dy * dy + dx * dx, r, dx
        dy += 1
    return best, where, col + beside if _is_open(part, where, col + beside) else col - beside


@kernel_part
def _any_in(cells: Bits, row: int, w: int, mask: np.uint64, rows: int) -> np.uint64:
    """Return the cells that are set in some rows of a word."""
    some = NONE
    for r in range(row, min(row + rows, len(cells))):
        some |= cells[r, w] & mask
    return some


@kernel_part
def _farthest_cells(part: Bits, cells: Bits, shift: int, best2: int, most2: int) -> Array2D[np.int64]:
    """Return the cells of greatest clearance among those `shift` rows and columns beyond the set cells.

    The result is that of `greatest_clearance`.

    Some cell's squared distance is at least `best2`. Distances change by no more than the way between two
    cells. So of a square of cells only those are split whose middle is far enough from the outside for a cell
    in it to be the farthest (branch and bound). Recent nearest outside cells bound most distances without a
    search.
    """
    block, n = 1, 0
    while block < 64 and 2 * block <= 0.6 * (np.sqrt(best2) - 1.0):
        block *= 2
    blocks = np.empty((256, 3), np.int64)
    for r in range(0, len(cells), block):
        for w in range(cells.shape[1]):
            some = _any_in(cells, r, w, ALL, block)
            while some != NONE:
                at = signed(lowest(some)) & -block
                some &= ~((ALL >> np.uint64(64 - block)) << np.uint64(at))
                if n == len(blocks):
                    blocks = doubled(blocks)
                blocks[n, 0], blocks[n, 1] = r, 64 * w + at
                n += 1
    nearest, n_nearest = np.empty((WITNESSES, 2), np.int64), 0
    while True:
        away, middle = np.sqrt(0.5) * (block if block > 1 else 0), shift + (block >> 1)
        for i in range(n):
            least = max(0.0, np.sqrt(best2) - 0.5 - away)
            least2 = int(least * least)
            r, c, bound2 = blocks[i, 0] + middle, blocks[i, 1] + middle, most2
            for k in range(min(n_nearest, WITNESSES)):
                down, right = r - nearest[k, 0], c - nearest[k, 1]
                bound2 = min(bound2, down * down + right * right)
            blocks[i, 2] = bound2
            if bound2 < least2:
                continue
            blocks[i, 2], row, col = _distance2(part, r, c, least2, bound2)
            if blocks[i, 2] < bound2:
                nearest[n_nearest % WITNESSES, 0], nearest[n_nearest % WITNESSES, 1] = row, col
                n_nearest += 1
            best2 = max(best2, blocks[i, 2])
        keep, least = 0, np.sqrt(best2) - 0.5 - away
        for i in range(n):
            if np.sqrt(blocks[i, 2]) >= least - 1e-9 * away:
                blocks[keep, 0], blocks[keep, 1], blocks[keep, 2] = blocks[i, 0], blocks[i, 1], blocks[i, 2]
                keep += 1
        if block == 1:
            break
        block >>= 1
        halves, n = np.empty((4 * keep, 3), np.int64), 0
        for i in range(keep):
            for r in range(blocks[i, 0], blocks[i, 0] + 2 * block, block):
                for c in range(blocks[i, 1], blocks[i, 1] + 2 * block, block):
                    mask = (ALL >> np.uint64(64 - block)) << np.uint64(c & 63)
                    if _any_in(cells, r, c >> 6, mask, block) != NONE:
                        halves[n, 0], halves[n, 1] = r, c
                        n += 1
        blocks = halves
    # The cells of a row are already in column order.
    place, found = np.zeros(part.shape[0] + 1, np.int64), np.empty((keep, 3), np.int64)
    for i in range(keep):
        place[blocks[i, 0] + shift + 1] += 1
    for r in range(part.shape[0]):
        place[r + 1] += place[r]
    for i in range(keep):
        r = blocks[i, 0] + shift
        found[place[r], 0], found[place[r], 1], found[place[r], 2] = r, blocks[i, 1] + shift, blocks[i, 2]
        place[r] += 1
    return found


@kernel
def greatest_clearance(part: Bits, side: int, hints: Array2D[np.int64]) -> Array2D[np.int64]:
    """Return the cells farthest from the outside of a part whose largest square has the given side.

    The farthest cell is at least as far as the middle of the square. Around any cell nearly as far from the
    outside a square fits that is smaller by the root of two.

    Parameters
    ----------
    hints
        (n, 2 or more) rows and columns that may be far from the outside, which only saves time.

    Returns
    -------
    (n, 3) row, column and squared distance to the outside, of the cells whose distance is within half a cell
    of the greatest, in raster order.
    """
    inner, most2 = (side - 1) // 2, 2 * (side + 2) * (side + 2)
    least2 = (inner + 1) * (inner + 1)
    for i in range(len(hints)):
        if not _is_open(part, hints[i, 0], hints[i, 1]):
            least2 = max(least2, _distance2(part, hints[i, 0], hints[i, 1], least2, most2)[0])
    half, corners = max(0, int(np.ceil((np.sqrt(least2) - 0.5) / np.sqrt(2.0) - 1))), part.copy()
    erode_to_side(corners, 1, 2 * half + 1)
    return _farthest_cells(part, corners, half, least2, most2)


@kernel_of_source_mode
def square_and_clearance(
    part: Bits, corners: Bits, least: int
) -> tuple[int, tuple[int, int], Array2D[np.int64]]:
    """Return the side of a part's largest square, its first corner, and its `greatest_clearance`.

    Parameters
    ----------
    corners
        South-west corners of the squares of side `least` in the part; at least one.
    """
    side, where = _largest(corners, least)
    middle = np.array([[where[0] + (side - 1) // 2, where[1] + (side - 1) // 2]])
    return side, where, greatest_clearance(part, side, middle)


@kernel_part
def distances2(part: Bits, cells: Strided2D[np.int64], side: int) -> Array1D[np.int64]:
    """Return the squared distances (n,) from cells (n, 2) to the outside of a part.

    Parameters
    ----------
    side
        Of the part's largest square, which bounds them.
    """
    found, most2 = np.empty(len(cells), np.int64), 2 * (side + 2) * (side + 2)
    for i in range(len(cells)):
        found[i] = _distance2(part, cells[i, 0], cells[i, 1], 0, most2)[0]
    return found


@kernel
def most_certain(
    cells: Strided2D[np.int64],
    certainty: Array1D[np.float32],
    slope: Array1D[np.float32],
    west: float,
    south: float,
    cell: float,
    sensor_east: float,
    sensor_north: float,
) -> int:
    """Return the index of the most certain cell, to a thousandth; of these the `least_steep`."""
    best, most, least, nearest = 0, -np.inf, np.inf, np.inf
    for i in range(len(cells)):
        sure, steep = np.rint(certainty[i] * np.float32(1000)), np.rint(slope[i] * np.float32(10))
        if sure < most or (sure == most and steep > least):
            continue
        east, north = west + (cells[i, 1] + 0.5) * cell, south + (cells[i, 0] + 0.5) * cell
        way = np.hypot(east - sensor_east, north - sensor_north) // cell
        if not way < np.inf:
            way = 0.0
        if sure > most or steep < least or way < nearest:
            best, most, least, nearest = i, sure, steep, way
    return best


@kernel_of_source_mode
def least_steep(
    cells: Array2D[np.int64],
    slope: Array3D[np.float32],
    row0: int,
    col0: int,
    west: float,
    south: float,
    cell: float,
    sensor_east: float,
    sensor_north: float,
) -> int:
    """Return the index of the cell of least slope, to a tenth of a degree; of these the nearest one."""
    best, least, nearest = 0, np.inf, np.inf
    for i in range(len(cells)):
        r, c = row0 + cells[i, 0], col0 + cells[i, 1]
        steep = np.rint(slope[c >> 6, r, c & 63] * np.float32(10.0))
        if steep > least:
            continue
        east, north = west + (c + 0.5) * cell - sensor_east, south + (r + 0.5) * cell - sensor_north
        way = np.floor(np.sqrt(east * east + north * north) / cell)
        if not way < np.inf:
            way = 0.0
        if steep < least or way < nearest:
            best, least, nearest = i, steep, way
    return best
