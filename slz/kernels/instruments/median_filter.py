"""Median filter, 3 x 3, that ignores missing pixels."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Strided2D
from slz.kernels.jit import kernel


@kernel
def median_of_neighbours(image: Strided2D[np.float64]) -> Strided2D[np.float64]:
    """Return the median of the known pixels among 9, 6 at edges and 4 at corners (Flash paper, Eq. (1)).

    Where no more than half of them are known, the result is NaN: a hole is not filled from its rim.
    """
    rows, cols = image.shape
    out = np.empty((rows, cols))
    held = np.empty(9)
    for r in range(rows):
        for c in range(cols):
            n = every = 0
            for i in range(max(0, r - 1), min(rows, r + 2)):
                for j in range(max(0, c - 1), min(cols, c + 2)):
                    every += 1
                    value = image[i, j]
                    if np.isnan(value):
                        continue
                    k = n
                    while k > 0 and held[k - 1] > value:
                        held[k] = held[k - 1]
                        k -= 1
                    held[k] = value
                    n += 1
            if 2 * n <= every:
                out[r, c] = np.nan
            elif n % 2:
                out[r, c] = held[n // 2]
            else:
                out[r, c] = 0.5 * (held[n // 2 - 1] + held[n // 2])
    return out
