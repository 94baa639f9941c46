"""Slope by central differences (SLZ paper Eq. 6-9)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

DEGREES = np.float32(57.29577951308232)


@kernel("float32[:, :](float32[:, :], float64)")
def gradient_slope_deg(height: NDArray[np.float32], cell: float) -> NDArray[np.float32]:
    """Return atan of the gradient's length in degrees; NaN where the cell or a neighbour of four is NaN.

    Eq. 8 of the paper prints E(j-1, j) for E(i-1, j). Applied to a slope map it gives the roughness map.
    """
    rows, cols = height.shape
    slope = np.full((rows, cols), np.float32(np.nan))
    k = np.float32(1.0 / (2.0 * cell))
    for r in range(1, rows - 1):
        for c in range(1, cols - 1):
            dx = (height[r, c + 1] - height[r, c - 1]) * k
            dy = (height[r + 1, c] - height[r - 1, c]) * k
            if np.isnan(height[r, c]) or np.isnan(dx) or np.isnan(dy):
                continue
            slope[r, c] = np.arctan(np.sqrt(dx * dx + dy * dy)) * DEGREES
    return slope
