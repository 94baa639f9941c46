"""Squares around cells: dilation and closing of bit maps, and the highest value."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.bits import NONE, ONE, Bits, word_at
from slz.kernels.erosion import grow
from slz.kernels.jit import kernel
from slz.kernels.lanes import LANES, every, flags_of, load, store, where

Row = NDArray[np.float32]
LOWEST = np.float32(-np.inf)


@kernel("void(uint64[:, ::1], int64)")
def _clear_beyond(bits: Bits, cols: int) -> None:
    """Clear the bits of the last words that stand for no column."""
    if cols & 63:
        for r in range(bits.shape[0]):
            bits[r, -1] &= (ONE << np.uint64(cols & 63)) - ONE


@kernel("uint64[:, ::1](uint64[:, ::1], int64, int64)")
def dilated(bits: Bits, radius: int, cols: int) -> Bits:
    """Return the cells with one that is set in the square of 2 radius + 1 cells around them."""
    rows, words = bits.shape
    east, west, side = bits.copy(), bits.copy(), 1
    while side <= radius:  # each cell of `east` stands for itself and side - 1 to its east
        step = min(side, radius + 1 - side)
        for r in range(rows):
            for w in range(words):
                east[r, w] |= word_at(east, r, 64 * w + step)
                v = words - 1 - w
                west[r, v] |= word_at(west, r, 64 * v - step)
        side += step
    north, south, side = east | west, east | west, 1
    while side <= radius:
        step = min(side, radius + 1 - side)
        for r in range(rows - step):
            for w in range(words):
                north[r, w] |= north[r + step, w]
                south[rows - 1 - r, w] |= south[rows - 1 - r - step, w]
        side += step
    out = north | south
    _clear_beyond(out, cols)
    return out


@kernel("uint64[:, ::1](uint64[:, ::1], int64, int64)")
def closed(bits: Bits, radius: int, cols: int) -> Bits:
    """Return the morphological closing by a square of 2 radius + 1 cells, the outside being unknown.

    Gaps narrower than the square are filled; the edge of the known ground is not moved outwards.
    """
    if radius == 0:
        return bits.copy()
    corner = dilated(bits, radius, cols)
    grow(corner, 1, 2 * radius + 1)
    out = bits.copy()
    for r in range(radius, bits.shape[0]):
        for w in range(bits.shape[1]):
            out[r, w] |= word_at(corner, r - radius, 64 * w - radius)
    return out


@kernel("uint64[:, ::1](uint64[:, ::1], int64)")
def others(bits: Bits, cols: int) -> Bits:
    """Return the cells that are not set."""
    out = ~bits
    _clear_beyond(out, cols)
    return out


@kernel("uint64[:, ::1](float32[:, ::1], float32)")
def above(values: NDArray[np.float32], limit: np.float32) -> Bits:
    """Return the cells whose value is above a limit; NaN is not."""
    rows, cols = values.shape
    out = np.zeros((rows, (cols + 63) >> 6), np.uint64)
    for r in range(rows):
        line = values[r]
        for w in range(cols >> 6):
            word = NONE
            for k in range(0, 64, LANES):
                word |= flags_of(every(limit) < load(line, 64 * w + k)) << np.uint64(k)
            out[r, w] = word
        for c in range(cols & ~63, cols):
            out[r, -1] |= np.uint64(line[c] > limit) << np.uint64(c & 63)
    return out


@kernel("void(float32[::1], int64, int64, int64, int64, float32, float32[::1], int64)")
def _highest(
    values: Row, first: int, count: int, radius: int, away: int, fall: float, out: Row, at: int
) -> None:
    """Leave the highest of 2 radius + 1 values around each, so far apart, less what each falls."""
    for c in range(0, count, LANES):
        top = load(values, first + c)
        for d in range(1, radius + 1):
            drop, ahead, behind = every(np.float32(fall * d)), first + c + d * away, first + c - d * away
            one, other = load(values, ahead), load(values, behind)
            best = where(one < other, other, one) - drop
            top = where(top < best, best, top)
        store(out, at + c, top)


@kernel("float32[:, :](float32[:, ::1], int64, float32)")
def highest_around(values: NDArray[np.float32], radius: int, fall: float) -> NDArray[np.float32]:
    """Return the maximum over a square of 2 radius + 1 cells around every cell, NaN being passed over.

    A value counts for less by `fall` with every row and column that it is away.
    """
    rows, cols = values.shape
    width = -(-cols // LANES) * LANES
    line, wide = np.full(width + 2 * radius, LOWEST), np.full((rows + 2 * radius) * width, LOWEST)
    inner = line[radius : radius + cols]
    for r in range(rows):
        for c in range(cols):
            inner[c] = values[r, c] if values[r, c] == values[r, c] else LOWEST
        _highest(line, radius, width, radius, 1, fall, wide, (radius + r) * width)
    out = np.empty((rows, width), np.float32)
    _highest(wide, radius * width, rows * width, radius, width, fall, out.ravel(), 0)
    return out[:, :cols]
