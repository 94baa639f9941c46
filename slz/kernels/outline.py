"""Rings along the edges of cells, and simpler rings beside them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

# Directions of travel: east, north, west, south; the cell to the left of each, from the vertex left behind.
ROW_AHEAD = np.array([0, 1, 0, -1], np.int64)
COL_AHEAD = np.array([1, 0, -1, 0], np.int64)
ROW_LEFT = np.array([0, 0, -1, -1], np.int64)
COL_LEFT = np.array([0, -1, -1, 0], np.int64)
RUN = 3


@kernel("boolean(uint8[:, :], int64, int64)")
def _cell(cells: NDArray[np.uint8], row: int, col: int) -> bool:
    if row < 0 or col < 0 or row >= cells.shape[0] or col >= cells.shape[1]:
        return False
    return bool(cells[row, col] != 0)


@kernel("int32[:, :](uint8[:, :])")
def edges(cells: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Return every ring around the set cells as (n, 3): ring number, row and column of unit-step vertices.

    Set cells lie to the left: outer rings run anticlockwise (rows grow to the north), holes clockwise. Where
    two cells touch at a corner only, rings keep to their own cell, so that no ring crosses another or itself.
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
            # Above set: travel east with it to the left. Below set: travel west, from the vertex to the east.
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
                    bigger = np.empty((2 * n, 3), np.int32)
                    bigger[:n] = out
                    out = bigger
                out[n, 0], out[n, 1], out[n, 2] = ring, r, c
                n += 1
                r, c = r + ROW_AHEAD[direction], c + COL_AHEAD[direction]
                for turn in (1, 0, 3):  # left first: diagonal neighbours stay apart
                    way = (direction + turn) & 3
                    left = _cell(cells, r + ROW_LEFT[way], c + COL_LEFT[way])
                    right_way = (way + 3) & 3
                    right = _cell(cells, r + ROW_LEFT[right_way], c + COL_LEFT[right_way])
                    if left and not right:
                        direction = way
                        break
            ring += 1
    return out[:n].copy()


@kernel("UniTuple(float64, 2)(int32[:, :], int64)")
def _place(ring: NDArray[np.int32], i: int) -> tuple[float, float]:
    """Return column and row of the i-th of vertices and middles of steps."""
    n = len(ring)
    a, b = (i // 2) % n, ((i + 1) // 2) % n
    return 0.5 * (ring[a, 1] + ring[b, 1]), 0.5 * (ring[a, 0] + ring[b, 0])


@kernel("boolean[:](int32[:, :])")
def _sharp(ring: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Tell which vertices lie between two straight runs of at least `RUN` steps at right angles."""
    n = len(ring)
    out = np.zeros(n, np.bool_)
    for i in range(n):
        row, col = ring[i, 0], ring[i, 1]
        back, ahead = (i - RUN) % n, (i + RUN) % n
        straight_in = abs(row - ring[back, 0]) + abs(col - ring[back, 1]) == RUN and (
            row == ring[back, 0] or col == ring[back, 1]
        )
        straight_out = row == ring[ahead, 0] or col == ring[ahead, 1]
        turned = (row == ring[back, 0]) != (row == ring[ahead, 0])
        far = abs(row - ring[ahead, 0]) + abs(col - ring[ahead, 1]) == RUN
        out[i] = straight_in and straight_out and turned and far
    return out


@kernel("float64(float64, float64, float64, float64)")
def _turn(ax: float, ay: float, bx: float, by: float) -> float:
    """Return the angle from a to b, anticlockwise."""
    return float(np.arctan2(ax * by - ay * bx, ax * bx + ay * by))


@kernel("float64[:, :](int32[:, :], float64)")
def simplified(ring: NDArray[np.int32], depth: float) -> NDArray[np.float64]:
    """Return a ring of few points beside a ring of unit steps, gaining no cell's centre.

    From each point kept, the farthest next one is taken whose chord has the centres of all cells on the right
    of the steps between on its right, and on its left the points so much deeper than the centres of the cells
    on the left: a cone of directions that narrows step by step. Points to choose from are the vertices and
    the middles of the steps; a corner between straight runs is preferred to what lies a step beyond it.

    Parameters
    ----------
    ring
        (n, 2) rows and columns of the vertices, the first not repeated; it is kept.
    depth
        Cells; with 0 no centre is lost either.

    Returns
    -------
    (m, 2) columns and rows.
    """
    n = len(ring)
    kept = np.empty((2 * n, 2))
    sharp = _sharp(ring)
    count, i = 0, 0
    while i < 2 * n:
        x0, y0 = _place(ring, i)
        kept[count, 0], kept[count, 1] = x0, y0
        count += 1
        ahead = i // 2
        dx = np.float64(ring[(ahead + 1) % n, 1] - ring[ahead, 1])
        dy = np.float64(ring[(ahead + 1) % n, 0] - ring[ahead, 0])
        best, corner, low, high = i + 1, -1, -np.pi, np.pi
        for j in range(i + 1, 2 * n + 1):
            step = (j - 1) // 2  # the step that ends at, or is halved by, point j
            ux = np.float64(ring[(step + 1) % n, 1] - ring[step, 1])
            uy = np.float64(ring[(step + 1) % n, 0] - ring[step, 0])
            mx, my = ring[step, 1] + ux / 2 - x0, ring[step, 0] + uy / 2 - y0
            low = max(low, _turn(dx, dy, mx + uy / 2, my - ux / 2))
            high = min(high, _turn(dx, dy, mx - uy * (0.5 + depth), my + ux * (0.5 + depth)))
            if low >= high:
                break
            x, y = _place(ring, j)
            if low + 1e-9 < _turn(dx, dy, x - x0, y - y0) < high - 1e-9:
                best = j
                if j % 2 == 0 and sharp[(j // 2) % n]:
                    corner = j
        i = corner if best - corner <= 2 else best
    return kept[:count].copy()
