"""Neighbourhoods of surface cells: sums and greatest values over squares."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D, Array3D
from slz.kernels.jit import kernel


@kernel
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


@kernel
def greatest_around(values: Array2D[np.int32], radius: int) -> Array2D[np.int32]:
    """Return the greatest value within squares of `radius` cells to every side; no value is below 0."""
    rows, cols = values.shape
    across, out = np.zeros((rows, cols), np.int32), np.zeros((rows, cols), np.int32)
    for r in range(rows):
        for c in range(cols):
            v = values[r, c]
            if v > 0:
                for k in range(max(0, c - radius), min(cols, c + radius + 1)):
                    across[r, k] = max(across[r, k], v)
    for r in range(rows):
        for k in range(max(0, r - radius), min(rows, r + radius + 1)):
            for c in range(cols):
                out[r, c] = max(out[r, c], across[k, c])
    return out
