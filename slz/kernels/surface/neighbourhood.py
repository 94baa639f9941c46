"""Neighbourhoods of surface cells: sums over squares."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array3D
from slz.kernels.jit import kernel_part


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
