"""Relief of footprints: peak-to-peak height about their planes, sixteen at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel_for_any_types
from slz.kernels.simd import Floats, broadcast, fused_multiply_add, load, maximum, minimum

F0, HIGHEST, LOWEST = np.float32(0), np.float32(np.inf), np.float32(-np.inf)
Row = NDArray[np.float32]
Pair = Any  # of lanes


@kernel_for_any_types
def _of_row(lower: Row, upper: Row, at: int, away: Row, first: int, stop: int, west: Floats) -> Pair:
    """Return the lowest and highest of cells of a row, less the eastward rise of the plane."""
    low, high = broadcast(HIGHEST), broadcast(LOWEST)
    for d in range(first, stop):
        far = broadcast(away[d])
        low = minimum(fused_multiply_add(west, far, load(lower, at + d)), low)
        high = maximum(fused_multiply_add(west, far, load(upper, at + d)), high)
    return low, high


@kernel_for_any_types
def relief_without_one(
    lower: Row, upper: Row, at: int, wide: int, away: Row, west: Floats, north: Floats, level: Floats
) -> Floats:
    """Return the relief of 16 footprints about their planes, less a lone extreme; see `reliefs`."""
    side, lowest, highest = len(away), broadcast(HIGHEST), broadcast(LOWEST)
    lowest2, highest2 = lowest, highest
    for i in range(side):
        row, up = at + i * wide, level + north * broadcast(away[i])
        for d in range(side):
            far = broadcast(away[d])
            low = fused_multiply_add(west, far, load(lower, row + d)) - up
            high = fused_multiply_add(west, far, load(upper, row + d)) - up
            lowest2, highest2 = (
                minimum(maximum(low, lowest), lowest2),
                maximum(minimum(high, highest), highest2),
            )
            lowest, highest = minimum(low, lowest), maximum(high, highest)
    return maximum(minimum(highest2 - lowest, highest - lowest2), broadcast(F0))


@kernel_for_any_types
def reliefs(
    lower: Row, upper: Row, at: int, wide: int, away: Row, west: Pair, north: Pair, level: Pair
) -> Pair:
    """Return the relief of 16 footprints about their planes, and of the 16 footprints one row to the north.

    Parameters
    ----------
    lower, upper
        Lowest and highest ground of the cells, `wide` cells a row; +inf and -inf where unknown.
    at
        Index of the south-west cell of the first footprint.
    away
        East offsets of the columns of a footprint from its middle, in cells.
    west, north, level
        For both rows: fall of the planes to the east and rise to the north per cell, and height at the
        middle.
    """
    side = len(away)
    low, high = _of_row(lower, upper, at, away, 0, side, west[0])
    up = level[0] + north[0] * broadcast(away[0])
    lowest, highest = low - up, high - up
    low, high = _of_row(lower, upper, at + side * wide, away, 0, side, west[1])
    up = level[1] + north[1] * broadcast(away[side - 1])
    lowest2, highest2 = low - up, high - up
    for i in range(1, side):
        row, low, high = at + i * wide, broadcast(HIGHEST), broadcast(LOWEST)
        low2, high2 = low, high
        for d in range(side):  # each cell is loaded once for both rows of footprints
            far, bottom, top = broadcast(away[d]), load(lower, row + d), load(upper, row + d)
            low = minimum(fused_multiply_add(west[0], far, bottom), low)
            high = maximum(fused_multiply_add(west[0], far, top), high)
            low2 = minimum(fused_multiply_add(west[1], far, bottom), low2)
            high2 = maximum(fused_multiply_add(west[1], far, top), high2)
        up, up2 = level[0] + north[0] * broadcast(away[i]), level[1] + north[1] * broadcast(away[i - 1])
        lowest, highest = minimum(low - up, lowest), maximum(high - up, highest)
        lowest2, highest2 = minimum(low2 - up2, lowest2), maximum(high2 - up2, highest2)
    return maximum(highest - lowest, broadcast(F0)), maximum(highest2 - lowest2, broadcast(F0))
