"""Quality-guided phase unwrapping."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Strided2D
from slz.kernels.jit import kernel

LEVELS = 256

F64 = Strided2D[np.float64]


@kernel
def unwrap_by_quality(phase: F64, quality: F64, least: float) -> tuple[F64, Strided2D[np.int32]]:
    """Unwrap a phase image from its best pixels outwards; return it and the region number of each pixel.

    Pixels of quality below `least` are NaN and of region 0. A region grows from the best pixel that has no
    region: always from the best pixel on its edge, to neighbours that then differ by at most half a turn.
    Regions do not touch, so the number of turns between them is unknown. Regions are numbered from 1.
    """
    rows, cols = phase.shape
    out = np.full((rows, cols), np.nan)
    region = np.zeros((rows, cols), np.int32)
    level = np.empty((rows, cols), np.int32)
    count = np.zeros(LEVELS + 1, np.int64)
    for r in range(rows):
        for c in range(cols):
            q = quality[r, c]
            good = q >= least and not np.isnan(phase[r, c])
            level[r, c] = min(LEVELS - 1, int(q * LEVELS)) if good else -1
            if good:
                count[level[r, c] + 1] += 1
    for k in range(LEVELS):
        count[k + 1] += count[k]
    place = count[:-1].copy()
    seeds = np.empty(count[LEVELS], np.int64)
    for r in range(rows):
        for c in range(cols):
            if level[r, c] >= 0:
                seeds[place[level[r, c]]] = r * cols + c
                place[level[r, c]] += 1
    # One stack of edge pixels for each level, linked through `below`; a pixel is in a stack at most once.
    head = np.full(LEVELS, -1, np.int64)
    below = np.full(rows * cols, -1, np.int64)
    parent = np.full(rows * cols, -1, np.int64)
    number = 0
    for s in range(len(seeds) - 1, -1, -1):
        start = seeds[s]
        if region[start // cols, start % cols] != 0:
            continue
        number += 1
        highest = level[start // cols, start % cols]
        head[highest] = start
        parent[start] = start
        while highest >= 0:
            at = head[highest]
            if at < 0:
                highest -= 1
                continue
            head[highest] = below[at]
            r, c = at // cols, at % cols
            from_r, from_c = parent[at] // cols, parent[at] % cols
            if parent[at] == at:
                out[r, c] = phase[r, c]
            else:
                step = phase[r, c] - out[from_r, from_c]
                out[r, c] = phase[r, c] - 2 * np.pi * np.floor(step / (2 * np.pi) + 0.5)
            region[r, c] = number
            for k in range(4):
                i, j = r + (k == 0) - (k == 1), c + (k == 2) - (k == 3)
                if i < 0 or j < 0 or i >= rows or j >= cols or level[i, j] < 0:
                    continue
                near = i * cols + j
                if parent[near] >= 0:
                    continue
                parent[near] = at
                below[near] = head[level[i, j]]
                head[level[i, j]] = near
                highest = max(highest, level[i, j])
    return out, region
