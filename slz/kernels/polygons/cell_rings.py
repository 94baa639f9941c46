"""Boundary rings along cell edges (crack following)."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Strided2D
from slz.kernels.growable_array import doubled
from slz.kernels.jit import kernel, kernel_part

# Directions of travel: east, north, west, south; offset from the vertex behind to the cell on the left.
ROW_AHEAD = np.array([0, 1, 0, -1], np.int64)
COL_AHEAD = np.array([1, 0, -1, 0], np.int64)
ROW_LEFT = np.array([0, 0, -1, -1], np.int64)
COL_LEFT = np.array([0, -1, -1, 0], np.int64)


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
