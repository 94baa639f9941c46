"""Patch of a map's heights, with which single returns are compared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Heights = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class HeightPatch:
    """Read-only square cells around a place; row 0 is the southernmost.

    top_m: (rows, cols) float32, highest of what stands in the cell and those around, or of the ground, up in
    the map frame; NaN where unknown. even: (rows, cols), known cells among which nothing stands.
    """

    west_m: float
    south_m: float
    cell_m: float
    top_m: Heights
    even: NDArray[np.bool_]


def highest_around(ground_m: Heights, top_m: Heights, relief_m: float) -> tuple[Heights, NDArray[np.bool_]]:
    """Return the highest top of 3 x 3 cells, NaN where unknown, and the known cells that are even.

    An edge is not certain to within a cell. Even are 3 x 3 cells whose ground and tops differ by less than
    `relief_m`.
    """
    known = np.isfinite(ground_m)
    high = ndimage.maximum_filter(np.where(np.isfinite(top_m), top_m, -np.inf), size=3, mode="nearest")
    low = ndimage.minimum_filter(np.where(known, ground_m, np.inf), size=3, mode="nearest")
    tops = np.where(np.isfinite(high), high, np.nan).astype(np.float32)
    return tops, known & (high - low < relief_m)
