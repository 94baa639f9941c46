"""Shores of level extents: growth up to the first cell that rises, and what water of one level floods."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel_part
from slz.kernels.surface.masks import SIDES


@kernel_part
def grow_extents(
    count: Array2D[np.float32],
    mean: Array2D[np.float32],
    labels: Array2D[np.int32],
    level: Array2D[np.float32],
    band: Array1D[np.float64],
    times: int,
) -> None:
    """Grow labels and levels `times` by one cell to cells unseen, or within the band of the level beside."""
    rows, cols = labels.shape
    added, n_added = np.empty((rows * cols, 2), np.int32), 0
    found, turn = np.empty((rows * cols, 2), np.int32), np.zeros((rows, cols), np.int8)
    owner, height = np.empty(rows * cols, np.int32), np.empty(rows * cols)
    for r in range(rows):
        for c in range(cols):
            if labels[r, c] > 0:
                added[n_added, 0], added[n_added, 1] = r, c
                n_added += 1
    for time in range(1, times + 1):
        n_found = 0
        for k in range(n_added):  # only beside those is anything new
            for i in range(max(0, added[k, 0] - 1), min(rows, added[k, 0] + 2)):
                for j in range(max(0, added[k, 1] - 1), min(cols, added[k, 1] + 2)):
                    if labels[i, j] == 0 and turn[i, j] < time:
                        found[n_found, 0], found[n_found, 1], turn[i, j] = i, j, time
                        n_found += 1
        for k in range(n_found):
            r, c = found[k, 0], found[k, 1]
            nearest, total, n = 0, 0.0, 0
            for i in range(max(0, r - 1), min(rows, r + 2)):
                for j in range(max(0, c - 1), min(cols, c + 2)):
                    own = labels[i, j]
                    if own > nearest:
                        nearest, total, n = own, 0.0, 0
                    if own > 0 and own == nearest:
                        total += level[i, j]
                        n += 1
            height[k] = total / n
            belongs = not count[r, c] > 0 or abs(mean[r, c] - height[k]) < band[nearest]
            owner[k] = nearest if belongs else 0
        n_added = 0
        for k in range(n_found):
            if owner[k] > 0:
                r, c = found[k, 0], found[k, 1]
                labels[r, c], level[r, c] = owner[k], height[k]
                added[n_added, 0], added[n_added, 1] = r, c
                n_added += 1


@kernel_part
def flood(
    seeds: Array2D[np.int32],
    level: Array2D[np.float32],
    may: Array2D[np.bool_],
    mean: Array2D[np.float32],
    least: float,
    deepest: float,
) -> None:
    """Spread labels and levels of seeds over connected cells `least` to `deepest` below the nearest."""
    rows, cols = seeds.shape
    queue, first, n = np.empty((rows * cols, 2), np.int32), 0, 0
    for r in range(rows):
        for c in range(cols):
            if seeds[r, c] > 0:
                queue[n, 0], queue[n, 1] = r, c
                n += 1
    while first < n:
        r, c = queue[first, 0], queue[first, 1]
        first += 1
        for dr, dc in SIDES:
            i, j = r + dr, c + dc
            if i < 0 or j < 0 or i >= rows or j >= cols or seeds[i, j] > 0 or not may[i, j]:
                continue
            if -deepest < mean[i, j] - level[r, c] < -least:
                seeds[i, j], level[i, j] = seeds[r, c], level[r, c]
                queue[n, 0], queue[n, 1] = i, j
                n += 1
