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
    level: Array2D[np.float32],
    seen: Array2D[np.bool_],
    mean: Array2D[np.float32],
    band: Array1D[np.float64],
) -> tuple[Array2D[np.int32], Array2D[np.float32]]:
    """Return labels and levels grown by one cell to cells unseen, or within the band of the level."""
    rows, cols = labels.shape
    out, grown = labels.copy(), level.copy()
    for r in range(rows):
        for c in range(cols):
            if labels[r, c] > 0:
                continue
            nearest, total, n = 0, 0.0, 0
            for i in range(max(0, r - 1), min(rows, r + 2)):
                for j in range(max(0, c - 1), min(cols, c + 2)):
                    own = int(labels[i, j])
                    if own > nearest:
                        nearest, total, n = own, 0.0, 0
                    if own > 0 and own == nearest:
                        total += level[i, j]
                        n += 1
            if nearest > 0 and (not seen[r, c] or abs(mean[r, c] - total / n) < band[nearest]):
                out[r, c], grown[r, c] = nearest, total / n
    return out, grown


@kernel
def around_shore(
    whole: Array2D[np.bool_],
    seen: Array2D[np.bool_],
    mean: Array2D[np.float32],
    level: Array2D[np.float32],
    reach: int,
    least: float,
    most: float,
    sectors: int,
    count: Array1D[np.int64],
) -> int:
    """Count the cells around an extent: UP, DOWN, EVEN by `least`, into `count`; none higher than `most`.

    A cell is compared with the nearest level (rows, cols; NaN for none) within `reach` cells. Return the
    number of directions from the middle of `whole`, of `sectors`, in which most of them are up.
    """
    rows, cols = whole.shape
    toward = np.zeros((sectors, 2), np.int64)
    middle_row = middle_col = n = 0.0
    for r in range(rows):
        for c in range(cols):
            if whole[r, c]:
                middle_row, middle_col, n = middle_row + r, middle_col + c, n + 1
    middle_row, middle_col = middle_row / max(n, 1.0), middle_col / max(n, 1.0)
    for r in range(rows):
        for c in range(cols):
            if whole[r, c] or not seen[r, c]:
                continue
            beside, nearest = math.nan, 2 * reach * reach + 1
            for i in range(max(0, r - reach), min(rows, r + reach + 1)):
                for j in range(max(0, c - reach), min(cols, c + reach + 1)):
                    far = (i - r) * (i - r) + (j - c) * (j - c)
                    if far < nearest and not math.isnan(level[i, j]):
                        beside, nearest = level[i, j], far
            above = mean[r, c] - beside
            if math.isnan(above) or above > most:
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
    level: Array2D[np.float32],
    seen: Array2D[np.bool_],
    mean: Array2D[np.float32],
    least: float,
    deepest: float,
) -> Array2D[np.int32]:
    """Return the labels of seeds spread over connected cells `least` to `deepest` below the nearest."""
    rows, cols = seeds.shape
    out, height, queue, n = seeds.copy(), level.copy(), np.empty((rows * cols, 2), np.int32), 0
    for r in range(rows):
        for c in range(cols):
            if seeds[r, c] > 0:
                queue[n, 0], queue[n, 1] = r, c
                n += 1
    first = 0
    while first < n:
        r, c = queue[first, 0], queue[first, 1]
        first += 1
        for dr, dc in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            i, j = r + dr, c + dc
            if i < 0 or j < 0 or i >= rows or j >= cols or out[i, j] > 0 or not seen[i, j]:
                continue
            if -deepest < mean[i, j] - height[r, c] < -least:
                out[i, j], height[i, j] = out[r, c], height[r, c]
                queue[n, 0], queue[n, 1] = i, j
                n += 1
    return out
