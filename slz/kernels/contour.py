"""Moore neighbours and square search on a binary map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

# Moore neighbours clockwise from west (SLZ paper Table 1); rows grow to the north.
COL_STEP = np.array([-1, -1, 0, 1, 1, 1, 0, -1], np.int64)
ROW_STEP = np.array([0, -1, -1, -1, 0, 1, 1, 1], np.int64)


@kernel("int32[:, :](uint8[:, :])")
def squares(safe: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Return the side in cells of the largest safe square whose last row and column end at every cell."""
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
