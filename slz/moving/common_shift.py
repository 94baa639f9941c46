"""Shift of all heights since the map was made: the navigation's height drifts, or jumps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FEWEST_CELLS = 30  # of even ground that tell a shift


def common_shift_m(over_m: NDArray[np.float64], cell: NDArray[np.intp]) -> float:
    """Return by how much returns are higher than the map in common; 0 where too little even ground is seen.

    Each cell has one vote, its lowest return: an object returns more than the ground that it covers, and a
    wall more than the street before it.

    Parameters
    ----------
    over_m, cell
        (n,) heights over the map of returns on even ground, and numbers of their cells.
    """
    cells, of_cell = np.unique(cell, return_inverse=True)
    if len(cells) < FEWEST_CELLS:
        return 0.0
    lowest = np.full(len(cells), np.inf)
    np.minimum.at(lowest, of_cell, over_m)
    return float(np.median(lowest))
