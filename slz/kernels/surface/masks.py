"""Masks of surface cells: closing, and filling of holes."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D
from slz.kernels.jit import kernel

REACH = 2  # steps to a side that closing spreads and shrinks by


@kernel
def closed(mask: Array2D[np.bool_]) -> Array2D[np.bool_]:
    """Return a mask spread and then shrunk by `REACH` steps to four sides; nothing is beyond its rim."""
    rows, cols = mask.shape
    wide, out = np.zeros((rows + 2 * REACH, cols + 2 * REACH), np.bool_), np.ones((rows, cols), np.bool_)
    for r in range(rows):
        for c in range(cols):
            if mask[r, c]:
                for i in range(-REACH, REACH + 1):
                    for j in range(abs(i) - REACH, REACH + 1 - abs(i)):
                        wide[r + i + REACH, c + j + REACH] = True
    for r in range(rows):
        for c in range(cols):
            for i in range(-REACH, REACH + 1):
                for j in range(abs(i) - REACH, REACH + 1 - abs(i)):
                    inside = 0 <= r + i < rows and 0 <= c + j < cols
                    out[r, c] &= inside and wide[r + i + REACH, c + j + REACH]
    return out


@kernel
def filled(mask: Array2D[np.bool_]) -> Array2D[np.bool_]:
    """Return a mask with its holes: what cannot reach the rim over four sides without crossing it."""
    rows, cols = mask.shape
    out, stack, n = np.ones((rows, cols), np.bool_), np.empty((rows * cols, 2), np.int32), 0
    for r in range(rows):
        for c in range(cols):
            rim = r == 0 or c == 0 or r == rows - 1 or c == cols - 1
            if rim and not mask[r, c]:
                out[r, c] = False
                stack[n, 0], stack[n, 1] = r, c
                n += 1
    while n > 0:
        n -= 1
        r, c = stack[n, 0], stack[n, 1]
        for dr, dc in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            i, j = r + dr, c + dc
            if 0 <= i < rows and 0 <= j < cols and out[i, j] and not mask[i, j]:
                out[i, j] = False
                stack[n, 0], stack[n, 1] = i, j
                n += 1
    return out
