"""Plateaus: connected surface cells without a step between them, and the drops along their edges."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel, kernel_part

FLAT_M = 0.5  # between two places at the foot of a wall


@kernel_part
def _root(parent: Array1D[np.int32], i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = int(parent[i])
    return i


@kernel
def connect(height: Array2D[np.float32], step: float, out: Array2D[np.int32]) -> int:
    """Label the cells joined by steps of at most `step`, from 1 on; 0 where the height is NaN.

    Neighbours are the four next cells, and the next but one across a single unknown cell. Return the number
    of labels.
    """
    rows, cols = height.shape
    parent = np.empty(rows * cols, np.int32)
    for i in range(rows * cols):
        parent[i] = i
    for r in range(rows):
        for c in range(cols):
            h = height[r, c]
            if np.isnan(h):
                continue
            for dr, dc in ((1, 0), (0, 1)):
                r1, c1, most = r + dr, c + dc, step
                if r1 < rows and c1 < cols and np.isnan(height[r1, c1]):
                    r1, c1 = r1 + dr, c1 + dc
                if r1 < rows and c1 < cols and abs(height[r1, c1] - h) <= most:
                    a, b = _root(parent, r * cols + c), _root(parent, r1 * cols + c1)
                    if a < b:
                        parent[b] = a
                    elif b < a:
                        parent[a] = b
    n = 0
    for r in range(rows):
        for c in range(cols):
            if np.isnan(height[r, c]):
                out[r, c] = 0
                continue
            i = r * cols + c
            root = _root(parent, i)
            if root == i:
                n += 1
                out[r, c] = n
            else:
                out[r, c] = out[root // cols, root % cols]
    return n


@kernel
def edges(
    height: Array2D[np.float32],
    labels: Array2D[np.int32],
    holes: Array2D[np.int32],
    n: int,
    least: float,
    reach: int,
    drops: Array2D[np.float32],
    held: Array1D[np.int64],
) -> tuple[Array1D[np.int64], Array1D[np.int64]]:
    """Return for each label the number of edges to other known cells, and of those that drop by `least`.

    An edge is a direction along rows or columns in which the next cell is not of the label. What lies there
    is the lowest of the next `reach` cells, so that a parapet or an unseen foot of a wall does not hide a
    drop. Where only the next ones were seen and are as high, what lies there is unknown.
    The cells of `holes` lie within their label, as a pit does: its edge is none. Up to drops.shape[1]
    drops of each label go to `drops`, and their number to `held`.
    """
    rows, cols = height.shape
    known, down = np.zeros(n + 1, np.int64), np.zeros(n + 1, np.int64)
    for r in range(rows):
        for c in range(cols):
            own = labels[r, c]
            if own == 0:
                continue
            for dr, dc in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                r1, c1 = r + dr, c + dc
                if r1 < 0 or c1 < 0 or r1 >= rows or c1 >= cols or labels[r1, c1] == own:
                    continue
                if holes[r1, c1] == own:
                    continue
                lowest, foot, again, farthest = np.inf, np.inf, False, 0
                for k in range(1, reach + 1):
                    r1, c1 = r + k * dr, c + k * dc
                    if r1 < 0 or c1 < 0 or r1 >= rows or c1 >= cols:
                        break
                    if labels[r1, c1] == own:
                        again = True
                        break
                    if not np.isnan(height[r1, c1]):
                        farthest = k
                        if height[r1, c1] < lowest:
                            lowest, foot = height[r1, c1], lowest
                        else:
                            foot = min(foot, height[r1, c1])
                drop = height[r, c] - lowest
                if again or (drop < least and farthest < reach - 1):  # a parapet, and nothing seen beyond
                    continue
                known[own] += 1
                if drop >= least:
                    down[own] += 1
                    if held[own] < drops.shape[1]:
                        # The foot is uneven: the mean of the two lowest, unless the other is of the wall.
                        drops[own, held[own]] = drop - (
                            (foot - lowest) / 2 if foot - lowest < FLAT_M else 0.0
                        )
                        held[own] += 1
    return known, down
