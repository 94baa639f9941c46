"""Repeatability of heights over square blocks of ground, and the points over some of them."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly2D
from slz.kernels.jit import kernel


@kernel
def spread_of_blocks(
    found: Array2D[np.float64], west: float, south: float, side: float, rows: int, cols: int, fewest: int
) -> Array2D[np.float64]:
    """Return the standard deviation of the differences in each of rows x cols blocks, NaN where unknown.

    Its square is half the mean square of successive differences (J. von Neumann et al., Annals of
    Mathematical Statistics 12, 1941), which slow changes of the vehicle's height and attitude do not raise.

    Parameters
    ----------
    found
        (m, 4) of `slz.kernels.cells.accumulate.differences`, all over the blocks, in the order of the window.
    west, south, side
        Corner of the blocks, and the side of one (m).
    fewest
        Pairs of successive returns, below which a block is unknown.
    """
    spread, pairs, last = np.zeros((rows, cols)), np.full((rows, cols), -1), np.zeros((rows, cols))
    for k in range(len(found)):
        r, c = int((found[k, 1] - south) / side), int((found[k, 0] - west) / side)
        pairs[r, c] += 1
        if pairs[r, c] > 0:
            spread[r, c] += (found[k, 2] - last[r, c]) ** 2
        last[r, c] = found[k, 2]
    for r in range(rows):
        for c in range(cols):
            n = pairs[r, c]
            spread[r, c] = np.sqrt(spread[r, c] / (2 * n)) if n >= fewest else np.nan
    return spread


@kernel
def over_blocks(
    points: ReadOnly2D[np.float64],
    which: Array1D[np.int64],
    west: float,
    south: float,
    side: float,
    blocks: Array2D[np.bool_],
) -> Array1D[np.bool_]:
    """Return which of some points, (m,) indices `which` of (n, 3), are over blocks that are set."""
    out, (rows, cols) = np.empty(len(which), np.bool_), blocks.shape
    for k in range(len(which)):
        r = int(np.floor((points[which[k], 1] - south) / side))
        c = int(np.floor((points[which[k], 0] - west) / side))
        out[k] = 0 <= r < rows and 0 <= c < cols and blocks[r, c]
    return out
