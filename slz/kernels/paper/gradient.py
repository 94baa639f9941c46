"""Slope map by central differences."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

DEGREES = np.float32(57.29577951308232)


@kernel("float32[:, :](float32[:, :], float64)")
def gradient_slope_deg(height: NDArray[np.float32], cell: float) -> NDArray[np.float32]:
    """Return the slope in degrees; NaN where the cell or one of its four neighbours is NaN.

    The gradient is SLZ paper, Eq. (6). Applied to a slope map, this is the roughness map.
    """
    rows, cols = height.shape
    slope = np.full((rows, cols), np.float32(np.nan))
    k = np.float32(1.0 / (2.0 * cell))
    for r in range(1, rows - 1):
        for c in range(1, cols - 1):
            dx = (height[r, c + 1] - height[r, c - 1]) * k  # SLZ paper, Eq. (7)
            # SLZ paper, Eq. (8), which is misprinted: E(j-1, j) for E(i-1, j)
            dy = (height[r + 1, c] - height[r - 1, c]) * k
            if np.isnan(height[r, c]) or np.isnan(dx) or np.isnan(dy):
                continue
            slope[r, c] = np.arctan(np.sqrt(dx * dx + dy * dy)) * DEGREES  # SLZ paper, Eq. (9)
    return slope
