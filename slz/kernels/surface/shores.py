"""Shores of level extents: their cells up to the first that rises, and what lies around them."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel

UP, DOWN, EVEN = range(3)


@kernel
def grow(
    labels: Array2D[np.int32],
    seen: Array2D[np.bool_],
    mean: Array2D[np.float32],
    level: Array1D[np.float64],
    band: Array1D[np.float64],
) -> Array2D[np.int32]:
    """Return labels grown by one cell to cells unseen, or whose mean is within the band of the level."""
    rows, cols = labels.shape
    out = labels.copy()
    for r in range(rows):
        for c in range(cols):
            if labels[r, c] > 0:
                continue
            nearest = 0
            for i in range(max(0, r - 1), min(rows, r + 2)):
                for j in range(max(0, c - 1), min(cols, c + 2)):
                    nearest = max(nearest, int(labels[i, j]))
            if nearest > 0 and (not seen[r, c] or abs(mean[r, c] - level[nearest]) < band[nearest]):
                out[r, c] = nearest
    return out


@kernel
def around_shore(
    ring: Array2D[np.bool_],
    mean: Array2D[np.float32],
    level: float,
    middle_row: float,
    middle_col: float,
    least: float,
    most: float,
    sectors: int,
    count: Array1D[np.int64],
) -> int:
    """Count the cells around an extent: UP, DOWN, EVEN by `least`, into `count`; none higher than `most`.

    Return the number of directions from its middle, of `sectors`, in which most of them are up.
    """
    toward = np.zeros((sectors, 2), np.int64)
    for r in range(ring.shape[0]):
        for c in range(ring.shape[1]):
            if not ring[r, c]:
                continue
            above = mean[r, c] - level
            if above > most:
                continue
            kind = UP if above > least else DOWN if above < -least else EVEN
            count[kind] += 1
            bearing = math.atan2(r - middle_row, c - middle_col) / (2 * math.pi) + 0.5
            sector = min(int(bearing * sectors), sectors - 1)
            toward[sector, 0] += 1
            toward[sector, 1] += kind == UP
    sides = 0
    for sector in range(sectors):
        sides += 2 * toward[sector, 1] > toward[sector, 0]
    return sides


@kernel
def flood(
    seeds: Array2D[np.int32],
    seen: Array2D[np.bool_],
    mean: Array2D[np.float32],
    level: Array1D[np.float64],
    least: float,
    deepest: float,
) -> Array2D[np.int32]:
    """Return the labels of seeds spread to all connected cells `least` to `deepest` below their level."""
    rows, cols = seeds.shape
    out, stack, n = seeds.copy(), np.empty((rows * cols, 2), np.int32), 0
    for r in range(rows):
        for c in range(cols):
            if seeds[r, c] > 0:
                stack[n, 0], stack[n, 1] = r, c
                n += 1
    while n > 0:
        n -= 1
        r, c = stack[n, 0], stack[n, 1]
        own = out[r, c]
        for dr, dc in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            i, j = r + dr, c + dc
            if i < 0 or j < 0 or i >= rows or j >= cols or out[i, j] > 0 or not seen[i, j]:
                continue
            if -deepest < mean[i, j] - level[own] < -least:
                out[i, j] = own
                stack[n, 0], stack[n, 1] = i, j
                n += 1
    return out
