"""How much room there is in a component: its largest square and the cells farthest from its edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.bits import NONE, ONE, Bits, leading, lowest, signed, word_at
from slz.kernels.erosion import grow
from slz.kernels.jit import kernel

RAYS = 16
FEW = 24  # cells that are looked at one by one
ROUNDS = 8  # in which the distance that the cells left must have is raised


@kernel("boolean(uint64[:, ::1])")
def _any(bits: Bits) -> bool:
    for r in range(bits.shape[0]):
        for w in range(bits.shape[1]):
            if bits[r, w] != NONE:
                return True
    return False


@kernel("int64(uint64[:, ::1], int64)")
def largest_square(corners: Bits, side: int) -> int:
    """Return the side of the largest square of set cells.

    Parameters
    ----------
    corners
        South-west corners of squares of this side; at least one.
    """
    step = side
    while step > 0:
        larger = corners.copy()
        grow(larger, side, side + step)
        if _any(larger):
            corners, side = larger, side + step
            step = side
        else:
            step = min(step, side) >> 1
            break
    while step > 0:
        larger = corners.copy()
        grow(larger, side, side + step)
        if _any(larger):
            corners, side = larger, side + step
        else:
            step >>= 1
    return side


@kernel("int64(uint64[:, ::1], int64, int64, int64, int64)")
def _distance2(part: Bits, row: int, col: int, least2: int, most2: int) -> int:
    """Return the squared distance from a cell to the nearest outside; any less than `least2` if it is."""
    best = most2
    dy = 0
    while dy * dy < best and best >= least2:
        for r in (row - dy, row + dy):
            dx = 0
            while dy * dy + dx * dx < best:
                open_ = ~word_at(part, r, col + dx)
                if open_ != NONE:
                    dx += signed(lowest(open_))
                    best = min(best, dy * dy + dx * dx)
                    break
                dx += 64
            dx = 0
            while dy * dy + dx * dx < best:
                open_ = ~word_at(part, r, col - dx - 63)
                if open_ != NONE:
                    dx += signed(leading(open_))
                    best = min(best, dy * dy + dx * dx)
                    break
                dx += 64
        dy += 1
    return best


@kernel("void(uint64[:, ::1], uint64[:, ::1], float64)")
def _reaching(part: Bits, cells: Bits, distance: float) -> None:
    """Keep the cells with nothing outside on a few rays just nearer than a distance."""
    down, right = np.empty(RAYS, np.int64), np.empty(RAYS, np.int64)
    for ray in range(RAYS):
        angle = 2 * np.pi * ray / RAYS
        down[ray], right[ray] = int((distance - 1e-6) * np.sin(angle)), int((distance - 1e-6) * np.cos(angle))
    for r in range(cells.shape[0]):
        for w in range(cells.shape[1]):
            word, ray = cells[r, w], 0
            while word != NONE and ray < RAYS:
                word &= word_at(part, r + down[ray], 64 * w + right[ray])
                ray += 1
            cells[r, w] = word


@kernel("int64[:, ::1](uint64[:, ::1])")
def _listed(cells: Bits) -> NDArray[np.int64]:
    """Return (n, 3) row, column and 0 of the set cells."""
    out, n = np.zeros((256, 3), np.int64), 0
    for r in range(cells.shape[0]):
        for w in range(cells.shape[1]):
            word = cells[r, w]
            while word != NONE:
                if n == len(out):
                    more = np.zeros((2 * n, 3), np.int64)
                    more[:n] = out
                    out = more
                out[n, 0], out[n, 1] = r, 64 * w + signed(lowest(word))
                n += 1
                word &= word - ONE
    return out[:n].copy()


@kernel("int64[:, ::1](uint64[:, ::1], int64)")
def widest(part: Bits, side: int) -> NDArray[np.int64]:
    """Return (n, 3) row, column and squared distance to the outside, of the cells farthest from it.

    Those whose distance is less than the greatest by at most half a cell, in the order of rows and columns.

    Parameters
    ----------
    side
        Side of the largest square in the part: a circle of its inner radius fits, and about any cell farther
        from the edge than that a square that is smaller by the root of two.
    """
    inner = (side - 1) // 2
    half = max(0, int(np.ceil((inner + 0.5) / np.sqrt(2.0) - 1)))
    corners = part.copy()
    grow(corners, 1, 2 * half + 1)
    cells = np.zeros_like(part)
    for r in range(half, part.shape[0]):
        for w in range(part.shape[1]):
            cells[r, w] = word_at(corners, r - half, 64 * w - half)
    most2 = 2 * (side + 2) * (side + 2)
    best2 = (inner + 1) * (inner + 1)
    listed = np.zeros((0, 3), np.int64)
    for _ in range(ROUNDS):
        _reaching(part, cells, np.sqrt(best2) - 0.5)
        listed = _listed(cells)
        if len(listed) <= FEW:
            break
        found = best2
        for i in range(0, len(listed), max(1, len(listed) // 4)):
            found = max(found, _distance2(part, listed[i, 0], listed[i, 1], best2, most2))
        if found == best2:
            break
        best2 = found
    for i in range(len(listed)):
        least = np.sqrt(best2) - 0.5
        listed[i, 2] = _distance2(part, listed[i, 0], listed[i, 1], int(least * least), most2)
        best2 = max(best2, listed[i, 2])
    keep, least = 0, np.sqrt(best2) - 0.5
    for i in range(len(listed)):
        if np.sqrt(listed[i, 2]) >= least:
            listed[keep] = listed[i]
            keep += 1
    return listed[:keep].copy()


@kernel("int64(int64[:, ::1], float32[:, ::1], int64, int64, float64, float64, float64, float64, float64)")
def first_choice(
    cells: NDArray[np.int64],
    slope: NDArray[np.float32],
    row0: int,
    col0: int,
    west: float,
    south: float,
    cell: float,
    sensor_east: float,
    sensor_north: float,
) -> int:
    """Return which cell slopes least, to a tenth of a degree; of these the nearest to the sensor."""
    best, least, nearest = 0, np.inf, np.inf
    for i in range(len(cells)):
        r, c = row0 + cells[i, 0], col0 + cells[i, 1]
        steep = np.rint(slope[r, c] * np.float32(10.0))
        if steep > least:
            continue
        east, north = west + (c + 0.5) * cell - sensor_east, south + (r + 0.5) * cell - sensor_north
        way = np.floor(np.sqrt(east * east + north * north) / cell)
        if not way < np.inf:
            way = 0.0
        if steep < least or way < nearest:
            best, least, nearest = i, steep, way
    return best
