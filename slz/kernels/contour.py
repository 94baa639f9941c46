"""Moore-neighbour tracing, square search and the inside of a contour, on a binary map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel
from slz.kernels.rows import doubled

# Moore neighbours clockwise from west (SLZ paper Table 1); rows grow to the north.
COL_STEP = np.array([-1, -1, 0, 1, 1, 1, 0, -1], np.int64)
ROW_STEP = np.array([0, -1, -1, -1, 0, 1, 1, 1], np.int64)


@kernel("int32[:, :](uint8[:, :], int64, int64, int64)")
def trace(safe: NDArray[np.uint8], row: int, col: int, timeout: int) -> NDArray[np.int32]:
    """Return the (n, 2) boundary cells (row, column) of the component whose raster-first cell is given.

    The tracing stops when it leaves the first cell in the first direction again, or after `timeout`
    cells. The map must have an unsafe margin of one cell.
    """
    out = np.empty((256, 2), np.int32)
    n = 0
    r, c, start, first = row, col, 1, -1
    while n < timeout:
        direction = -1
        for k in range(8):
            e = (start + k) & 7
            if safe[r + ROW_STEP[e], c + COL_STEP[e]]:
                direction = e
                break
        if direction >= 0 and r == row and c == col:
            if first < 0:
                first = direction
            elif direction == first:
                break
        if n == len(out):
            out = doubled(out)
        out[n, 0], out[n, 1] = r, c
        n += 1
        if direction < 0:
            break  # an isolated cell
        r, c = r + ROW_STEP[direction], c + COL_STEP[direction]
        start = (direction + 6) & 7 if direction & 1 else (direction + 7) & 7
    return out[:n].copy()


@kernel("int32[:, :](uint8[:, :])")
def squares(safe: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Return the side in cells of the largest safe square whose last row and column end at every cell."""
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


@kernel("uint8[:, :](int32[:, :], int64, int64, int64)")
def inside(boundary: NDArray[np.int32], margin: int, rows: int, cols: int) -> NDArray[np.uint8]:
    """Return 1 on and inside a closed 8-connected contour given in a box of rows x cols with a margin >= 1.

    Everything that is 4-connected to the frame of the box without crossing the contour is outside.
    """
    out = np.ones((rows, cols), np.uint8)
    wall = np.zeros((rows, cols), np.uint8)
    for i in range(len(boundary)):
        wall[boundary[i, 0] + margin, boundary[i, 1] + margin] = 1
    stack = [(0, 0)]
    while len(stack) > 0:
        r, c = stack.pop()
        if out[r, c] == 0 or wall[r, c]:
            continue
        left, right = c, c
        while left > 0 and not wall[r, left - 1] and out[r, left - 1]:
            left -= 1
        while right + 1 < cols and not wall[r, right + 1] and out[r, right + 1]:
            right += 1
        for j in range(left, right + 1):
            out[r, j] = 0
        for i in (r - 1, r + 1):
            if i < 0 or i >= rows:
                continue
            was = False
            for j in range(left, right + 1):
                open_ = not wall[i, j] and out[i, j] == 1
                if open_ and not was:
                    stack.append((i, j))
                was = open_
    return out
