"""Squares around cells: dilation, closing and the highest value."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

Row = NDArray[np.float32]


@kernel("uint8[:, ::1](uint8[:, ::1], int64)")
def dilated(known: NDArray[np.uint8], radius: int) -> NDArray[np.uint8]:
    """Return 1 where a cell of the square of 2 radius + 1 cells around is not 0."""
    rows, cols = known.shape
    wide = np.zeros((rows, cols), np.uint8)
    for r in range(rows):
        last = -radius - 1  # horizontal dilation by distance to the last known cell
        for c in range(cols):
            if known[r, c]:
                last = c
            if c - last <= radius:
                wide[r, c] = 1
        last = cols + radius + 1
        for c in range(cols - 1, -1, -1):
            if known[r, c]:
                last = c
            if last - c <= radius:
                wide[r, c] = 1
    out = np.zeros((rows, cols), np.uint8)
    seen = np.full(cols, -radius - 1)
    for r in range(rows):
        for c in range(cols):
            if wide[r, c]:
                seen[c] = r
            if r - seen[c] <= radius:
                out[r, c] = 1
    seen[:] = rows + radius + 1
    for r in range(rows - 1, -1, -1):
        for c in range(cols):
            if wide[r, c]:
                seen[c] = r
            if seen[c] - r <= radius:
                out[r, c] = 1
    return out


@kernel("uint8[:, ::1](uint8[:, ::1], int64)")
def closed(known: NDArray[np.uint8], radius: int) -> NDArray[np.uint8]:
    """Return the morphological closing by a square of 2 radius + 1 cells, the outside being unknown.

    Gaps narrower than the square are filled; the edge of the known ground is not moved outwards.
    """
    rows, cols = known.shape
    out = known.copy()
    if radius == 0:
        return out
    wide = dilated(known, radius)
    tall = np.zeros((rows, cols), np.uint8)
    run = np.zeros(cols, np.int64)
    for r in range(rows):  # vertical erosion by length of the run of cells
        for c in range(cols):
            run[c] = run[c] + 1 if wide[r, c] else 0
            if run[c] > 2 * radius:
                tall[r - radius, c] = 1
    for r in range(rows):
        length = 0
        for c in range(cols):
            length = length + 1 if tall[r, c] else 0
            if length > 2 * radius:
                out[r, c - radius] = 1
    return out


@kernel("void(float32[::1], float32[::1], float64)")
def _raise(values: Row, out: Row, fall: float) -> None:
    for c in range(np.uint64(len(out))):
        v = np.float32(values[c] - fall)
        out[c] = v if v > out[c] else out[c]  # NaN is not


@kernel("float32[:, :](float32[:, :], int64, float32)")
def highest_around(values: NDArray[np.float32], radius: int, fall: float) -> NDArray[np.float32]:
    """Return the maximum over a square of 2 radius + 1 cells around every cell, NaN being passed over.

    A value counts for less by `fall` with every row and column that it is away.
    """
    rows, cols = values.shape
    values = np.ascontiguousarray(values)
    wide = np.full((rows, cols), np.float32(-np.inf))
    for r in range(rows):
        for d in range(min(radius + 1, cols)):
            _raise(values[r, d:], wide[r, : cols - d], fall * d)
            _raise(values[r, : cols - d], wide[r, d:], fall * d)
    out = wide.copy()
    for r in range(rows):
        for i in range(max(0, r - radius), min(rows, r + radius + 1)):
            _raise(wide[i], out[r], fall * abs(i - r))
    return out
