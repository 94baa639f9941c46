"""Contour primitives: Moore neighbours, squares that end at each cell, and corners of a boundary."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Strided2D
from slz.kernels.jit import kernel, kernel_at_call

# Moore neighbours, clockwise from west (SLZ paper, Table 1); rows grow to the north.
COL_STEP = np.array([-1, -1, 0, 1, 1, 1, 0, -1], np.int64)
ROW_STEP = np.array([0, -1, -1, -1, 0, 1, 1, 1], np.int64)


@kernel_at_call
def squares(safe: Strided2D[np.uint8]) -> Strided2D[np.int32]:
    """Return, by cell, the side in cells of the largest safe square whose last row and column end there."""
    rows, cols = safe.shape
    side = np.zeros((rows, cols), np.int32)
    for r in range(rows):
        for c in range(cols):
            if safe[r, c]:
                if r == 0 or c == 0:
                    side[r, c] = 1
                else:
                    side[r, c] = 1 + min(side[r - 1, c], side[r, c - 1], side[r - 1, c - 1])
    return side


@kernel
def corner_indices(boundary: Array2D[np.int32]) -> Array1D[np.int32]:
    """Return the indices of the boundary cells that `slz.zones.boundary_points.without_collinear` keeps."""
    n, m = len(boundary), 0
    kept = np.empty(n, np.int32)
    for i in range(n):
        before, after = i - 1 if i > 0 else n - 1, i + 1 if i + 1 < n else 0
        r, c = boundary[i, 0], boundary[i, 1]
        r0, c0, r1, c1 = boundary[before, 0], boundary[before, 1], boundary[after, 0], boundary[after, 1]
        flat = (r0 == r and r1 == r) or (c0 == c and c1 == c)
        turns = (r - r0) * (r1 - r) + (c - c0) * (c1 - c) < 0  # the tip of a spur
        kept[m] = i
        m += not flat or turns or n == 1
    return kept[:m].copy()
