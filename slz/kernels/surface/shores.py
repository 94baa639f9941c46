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
def around_shores(
    ring: Array2D[np.int32],
    seen: Array2D[np.bool_],
    mean: Array2D[np.float32],
    level: Array1D[np.float64],
    middle: Array2D[np.float64],
    least: float,
    sectors: int,
    sides: Array1D[np.int64],
) -> Array2D[np.int64]:
    """Return (labels, 3) counts of the seen cells around each extent: UP, DOWN, EVEN by `least`.

    Parameters
    ----------
    ring
        Label of the extent that a cell is around, 0 for none.
    middle
        (labels, 2) mean row and column of each extent.
    sides
        Receives the number of directions, of `sectors`, in which most cells seen are up.
    """
    n = len(level)
    count, toward = np.zeros((n, 3), np.int64), np.zeros((n, sectors, 2), np.int64)
    for r in range(ring.shape[0]):
        for c in range(ring.shape[1]):
            own = ring[r, c]
            if own == 0 or not seen[r, c]:
                continue
            above = mean[r, c] - level[own]
            kind = UP if above > least else DOWN if above < -least else EVEN
            count[own, kind] += 1
            bearing = math.atan2(r - middle[own, 0], c - middle[own, 1]) / (2 * math.pi) + 0.5
            sector = min(int(bearing * sectors), sectors - 1)
            toward[own, sector, 0] += 1
            toward[own, sector, 1] += kind == UP
    for own in range(n):
        for sector in range(sectors):
            sides[own] += 2 * toward[own, sector, 1] > toward[own, sector, 0]
    return count


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
