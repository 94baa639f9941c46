"""Plateaus: connected surface cells without a step between them."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel_part


@kernel_part
def _root(parent: Array1D[np.int32], i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = int(parent[i])
    return i


@kernel_part
def connect(height: Array2D[np.float32], step: float) -> tuple[Array2D[np.int32], int]:
    """Label the cells joined by steps of at most `step`, from 1 on; 0 where the height is NaN.

    Neighbours are the four next cells, and the next but one across a single unknown cell. Return also the
    number of labels.
    """
    rows, cols = height.shape
    parent, out = np.empty(rows * cols, np.int32), np.zeros((rows, cols), np.int32)
    for i in range(rows * cols):
        parent[i] = i
    for r in range(rows):
        for c in range(cols):
            h = height[r, c]
            if np.isnan(h):
                continue
            for dr, dc in ((1, 0), (0, 1)):
                r1, c1 = r + dr, c + dc
                if r1 < rows and c1 < cols and np.isnan(height[r1, c1]):
                    r1, c1 = r1 + dr, c1 + dc
                if r1 < rows and c1 < cols and abs(height[r1, c1] - h) <= step:
                    a, b = _root(parent, r * cols + c), _root(parent, r1 * cols + c1)
                    if a < b:
                        parent[b] = a
                    elif b < a:
                        parent[a] = b
    n = 0
    for r in range(rows):
        for c in range(cols):
            if np.isnan(height[r, c]):
                continue
            i = r * cols + c
            root = _root(parent, i)
            if root == i:
                n += 1
                out[r, c] = n
            else:
                out[r, c] = out[root // cols, root % cols]
    return out, n
