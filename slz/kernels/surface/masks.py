"""Masks of surface cells: connected parts, closing, filling of holes; sums over squares."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D
from slz.kernels.jit import kernel_part

REACH = 2  # steps to a side that closing spreads and shrinks by
SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1))


@kernel_part
def box_sums(layers: Array3D[np.float32], radius: int) -> Array3D[np.float32]:
    """Return the sums of each layer over squares of `radius` cells to every side."""
    depth, rows, cols = layers.shape
    out, column = np.empty((depth, rows, cols), np.float32), np.empty(cols)
    for k in range(depth):
        column[:] = 0
        for r in range(-radius, rows):
            if r + radius < rows:
                for c in range(cols):
                    column[c] += layers[k, r + radius, c]
            if r - radius - 1 >= 0:
                for c in range(cols):
                    column[c] -= layers[k, r - radius - 1, c]
            if r < 0:
                continue
            total = 0.0
            for c in range(min(radius, cols)):
                total += column[c]
            for c in range(cols):
                if c + radius < cols:
                    total += column[c + radius]
                if c - radius - 1 >= 0:
                    total -= column[c - radius - 1]
                out[k, r, c] = total
    return out


@kernel_part
def connected_parts(
    mask: Array2D[np.bool_], cell_m2: float, least_m2: float
) -> tuple[Array2D[np.int32], int]:
    """Return labels of the parts of a mask joined over four sides, and how many with label 0, which is none.

    Parts smaller than `least_m2` have none, the others the next one in the order of their first cells.
    """
    rows, cols = mask.shape
    out, queue, n = np.zeros((rows, cols), np.int32), np.empty((rows * cols, 2), np.int32), 1
    left = mask.copy()
    for r in range(rows):
        for c in range(cols):
            if not left[r, c]:
                continue
            queue[0, 0], queue[0, 1], left[r, c] = r, c, False
            first, last = 0, 1
            while first < last:
                for dr, dc in SIDES:
                    i, j = queue[first, 0] + dr, queue[first, 1] + dc
                    if 0 <= i < rows and 0 <= j < cols and left[i, j]:
                        queue[last, 0], queue[last, 1], left[i, j] = i, j, False
                        last += 1
                first += 1
            if last * cell_m2 >= least_m2:
                for k in range(last):
                    out[queue[k, 0], queue[k, 1]] = n
                n += 1
    return out, n


@kernel_part
def bounding_boxes(labels: Array2D[np.int32], n: int, margin: int) -> Array2D[np.int64]:
    """Return first and last row and column of each of n labels and a margin, (n, 4), of labels that exist."""
    rows, cols = labels.shape
    out = np.empty((n, 4), np.int64)
    for label in range(n):
        out[label, 0], out[label, 1], out[label, 2], out[label, 3] = rows, -1, cols, -1
    for r in range(rows):
        for c in range(cols):
            own = labels[r, c]
            if own > 0:
                out[own, 0], out[own, 1] = min(out[own, 0], r), max(out[own, 1], r)
                out[own, 2], out[own, 3] = min(out[own, 2], c), max(out[own, 3], c)
    for label in range(n):
        out[label, 0], out[label, 1] = max(out[label, 0] - margin, 0), min(out[label, 1] + margin, rows - 1)
        out[label, 2], out[label, 3] = max(out[label, 2] - margin, 0), min(out[label, 3] + margin, cols - 1)
    return out


@kernel_part
def closed_mask(mask: Array2D[np.bool_], asked: Array2D[np.bool_]) -> Array2D[np.bool_]:
    """Return a mask spread and then shrunk by `REACH` steps to four sides, where asked; none is beyond it."""
    rows, cols = mask.shape
    wide, out = np.zeros((rows + 2 * REACH, cols + 2 * REACH), np.bool_), asked.copy()
    for r in range(rows):
        for c in range(cols):
            if mask[r, c]:
                for i in range(-REACH, REACH + 1):
                    for j in range(abs(i) - REACH, REACH + 1 - abs(i)):
                        wide[r + i + REACH, c + j + REACH] = True
    for r in range(rows):
        for c in range(cols):
            if asked[r, c]:
                for i in range(-REACH, REACH + 1):
                    for j in range(abs(i) - REACH, REACH + 1 - abs(i)):
                        inside = 0 <= r + i < rows and 0 <= c + j < cols
                        out[r, c] &= inside and wide[r + i + REACH, c + j + REACH]
    return out


@kernel_part
def with_holes(labels: Array2D[np.int32], label: int, box: Array1D[np.int64]) -> Array2D[np.bool_]:
    """Return a label's cells with holes: what cannot reach the rim of a box over four sides past the label.

    box: first and last row and column of what is returned.
    """
    row, col, rows, cols = box[0], box[2], box[1] - box[0] + 1, box[3] - box[2] + 1
    out, stack, n = np.ones((rows, cols), np.bool_), np.empty((rows * cols, 2), np.int32), 0
    for r in range(rows):
        for c in range(cols):
            rim = r == 0 or c == 0 or r == rows - 1 or c == cols - 1
            if rim and labels[row + r, col + c] != label:
                out[r, c] = False
                stack[n, 0], stack[n, 1] = r, c
                n += 1
    while n > 0:
        n -= 1
        r, c = stack[n, 0], stack[n, 1]
        for dr, dc in SIDES:
            i, j = r + dr, c + dc
            if 0 <= i < rows and 0 <= j < cols and out[i, j] and labels[row + i, col + j] != label:
                out[i, j] = False
                stack[n, 0], stack[n, 1] = i, j
                n += 1
    return out
