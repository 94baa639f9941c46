"""Largest inscribed square of a bitmap, and its maximum of the Euclidean distance transform."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D, Strided2D
from slz.kernels.growable_array import doubled
from slz.kernels.jit import kernel, kernel_of_source_mode, kernel_part
from slz.kernels.raster.bitmap import ALL, LAST, NONE, ONE, Bits, leading, lowest, signed, word_at

Word = Array1D[np.uint64]
Span = tuple[int, int, int, int]  # row0, row1, word0, word1 (half open); nothing is set outside
NEAR = 32  # columns to either side that one word around a cell covers
WITNESSES = 16  # recent nearest outside cells, kept for distance bounds
MIDDLE, NEAR_BITS = np.uint64(NEAR - 1), np.uint64(NEAR)


@kernel_part
def _erode_row(row: Word, out: Word, by: int) -> None:
    """Write the cells of a row whose neighbour `by` columns to the east is also set."""
    far, near = by >> 6, np.uint64(by & 63)
    rest, inner = np.uint64(63) - near, max(0, len(row) - far - 1)
    low, high = row[far:], row[far + 1 :]
    for w in range(np.uint64(inner)):
        out[w] = row[w] & ((low[w] >> near) | ((high[w] << rest) << ONE))
    for w in range(inner, len(row)):
        out[w] = row[w] & (row[w + far] >> near) if w + far < len(row) else NONE


@kernel_part
def _intersect(row: Word, other: Word) -> np.uint64:
    """Intersect a row with another one, in place; return 0 if nothing is left."""
    some = NONE
    for w in range(np.uint64(len(row))):
        row[w] &= other[w]
        some |= row[w]
    return some


@kernel_part
def _corners_of_larger(corners: Bits, span: Span, by: int, out: Bits) -> Span:
    """Reduce south-west corners of squares to those of squares larger by `by`, at most their side.

    Nothing is read or written outside the span. Return the span of the result, empty where nothing is left.
    """
    row0, row1, word0, word1 = span
    for r in range(row0, row1):
        _erode_row(corners[r, word0:word1], out[r, word0:word1], by)
    first, last, left, right = row1, row0, word1, word0
    for r in range(row0, row1 - by):
        if _intersect(out[r, word0:word1], out[r + by, word0:word1]) == NONE:
            continue
        first, last = min(first, r), r + 1
        a, b = word0, word1
        while a < left and out[r, a] == NONE:
            a += 1
        while b > right and out[r, b - 1] == NONE:
            b -= 1
        left, right = min(left, a), max(right, b)
    return first, last, left, right


@kernel_part
def _largest(corners: Bits, side: int) -> tuple[int, tuple[int, int], int, Bits, Span, Bits, Span]:
    """Return the side and first corner of the largest square; the greatest `side` times 2^k with a square.

    Then the corners of the squares of that side with their span, and the same of half of it. Cells outside a
    span are undefined.
    """
    span = (0, corners.shape[0], 0, corners.shape[1])
    before, before_span = corners, span
    double = side
    larger = np.empty_like(corners)
    while True:
        found = _corners_of_larger(corners, span, double, larger)
        if found[0] >= found[1]:
            break
        before, before_span = corners, span
        corners, span, double = larger, found, 2 * double
        larger = np.empty_like(corners)
    side, step = double, double >> 1
    best, best_span, other = corners, span, larger
    while step > 0:
        found = _corners_of_larger(best, best_span, step, other)
        if found[0] >= found[1]:
            step >>= 1
            continue
        side += step
        best, best_span, other = other, found, np.empty_like(corners)
    row, w = best_span[0], best_span[2]
    while best[row, w] == NONE:
        w += 1
        if w == best_span[3]:
            row, w = row + 1, best_span[2]
    where = row, 64 * w + signed(lowest(best[row, w]))
    return side, where, double, corners, span, before, before_span


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
def _any_in(cells: Bits, span: Span, row: int, col: int, side: int) -> bool:
    """Return whether a cell is set in an aligned square whose side is a power of two."""
    w = col >> 6
    if w < span[2] or w >= span[3]:
        return False
    mask = (ALL >> np.uint64(64 - side)) << np.uint64(col & 63)
    some = NONE
    for r in range(max(row, span[0]), min(row + side, span[1])):
        some |= cells[r, w] & mask
    return bool(some != NONE)


@kernel_part
def _farthest_cells(
    part: Bits, cells: Bits, span: Span, shift: int, best2: int, most2: int
) -> Array2D[np.int64]:
    """Return the cells of greatest clearance among those `shift` rows and columns beyond a span's set cells.

    The result is that of `square_and_clearance`.

    Some cell's squared distance is at least `best2`. Distances change by no more than the way between two
    cells. So of a square of cells only those are split whose middle is far enough from the outside for a cell
    in it to be the farthest (branch and bound). Recent nearest outside cells bound most distances without a
    search.
    """
    block, n = 1, 0
    while block < 64 and 2 * block <= 0.6 * (np.sqrt(best2) - 1.0):
        block *= 2
    blocks = np.empty((256, 3), np.int64)
    for r in range(span[0] & -block, span[1], block):
        for w in range(span[2], span[3]):
            some = NONE
            for row in range(max(r, span[0]), min(r + block, span[1])):
                some |= cells[row, w]
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
                    if _any_in(cells, span, r, c, block):
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


@kernel_part
def _half_side(least2: int) -> int:
    """Return the half side of a square that fits around any cell nearly this far from the outside."""
    return max(0, int(np.ceil((np.sqrt(least2) - 0.5) / np.sqrt(2.0) - 1)))


@kernel_part
def _clearance_among_corners(
    part: Bits, cells: Bits, span: Span, of: int, least2: int, side: int
) -> Array2D[np.int64]:
    """Return the cells farthest from the outside, at least `least2`, from the corners of smaller squares."""
    half = _half_side(least2)
    wanted = 2 * half + 1
    while of < wanted:
        step, larger = min(of, wanted - of), np.empty_like(part)
        span = _corners_of_larger(cells, span, step, larger)
        cells, of = larger, of + step
    return _farthest_cells(part, cells, span, half, least2, 2 * (side + 2) * (side + 2))


@kernel_of_source_mode
def square_and_clearance(
    part: Bits, corners: Bits, least: int
) -> tuple[int, tuple[int, int], Array2D[np.int64]]:
    """Return the side of a part's largest square, its corner, and the cells farthest from the outside.

    The farthest cell is at least as far as the middle of the square. Around any cell nearly as far from the
    outside a square fits that is smaller by the root of two.

    Parameters
    ----------
    corners
        South-west corners of the squares of side `least` in the part; at least one.

    Returns
    -------
    The side; row and column of the first such square's south-west corner; (n, 3) row, column and squared
    distance to the outside, of the cells whose distance is within half a cell of the greatest, in raster
    order.
    """
    side, where, double, cells, span, before, before_span = _largest(corners, least)
    inner, most2 = (side - 1) // 2, 2 * (side + 2) * (side + 2)
    least2 = _distance2(part, where[0] + inner, where[1] + inner, 0, most2)[0]
    wanted = 2 * _half_side(least2) + 1
    if double > wanted:
        cells, span, double = before, before_span, double >> 1
    if double > wanted or double < least:
        cells, span, double = part, (0, part.shape[0], 0, part.shape[1]), 1
    return side, where, _clearance_among_corners(part, cells, span, double, least2, side)


@kernel
def greatest_clearance(part: Bits, side: int) -> Array2D[np.int64]:
    """Return the cells as in `square_and_clearance`, for a part whose largest square has the given side."""
    inner = (side - 1) // 2
    return _clearance_among_corners(
        part, part, (0, part.shape[0], 0, part.shape[1]), 1, (inner + 1) * (inner + 1), side
    )


@kernel
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
