"""Shift and tilt of all ground since the map was made: by navigation, or by a mount that is told wrong."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.points.registration import FEWEST_SPREAD_M, MOST_TILT_RAD, median, robust_plane, wide_axes

FEWEST_CELLS = 30  # of even ground that determine a shift
AGREE_SHARE = 0.5  # of the cells, that agree with a tilt
ROUNDS = 3

Floats = NDArray[np.float64]


def common_shift_m(
    points_enu_m: Floats, over_m: Floats, cell: NDArray[np.intp], votes: NDArray[np.bool_]
) -> Floats:
    """Return by how much the ground at each return is higher than the map in common; 0 where too few vote.

    Each cell has one vote, its lowest return: an object returns more than the ground that it covers, and a
    wall more than the street before it. A tilt on which the cells do not agree is none.

    Parameters
    ----------
    points_enu_m, over_m, cell
        (n, 3) returns, (n,) heights over the map, and (n,) numbers of their cells.
    votes
        (n,), those on even ground.
    """
    cells, of_cell, count = np.unique(cell[votes], return_inverse=True, return_counts=True)
    if len(cells) < FEWEST_CELLS:
        return np.zeros(len(over_m))
    lowest = np.full(len(cells), np.inf)
    np.minimum.at(lowest, of_cell, over_m[votes])
    places = np.column_stack([np.bincount(of_cell, axis) / count for axis in points_enu_m[votes, :2].T])
    middle = places.mean(axis=0)
    axes = wide_axes(places - middle, FEWEST_SPREAD_M)
    (up, east, north), share = robust_plane(places - middle, lowest, axes, ROUNDS)
    if share < AGREE_SHARE or np.hypot(east, north) > MOST_TILT_RAD:
        return np.full(len(over_m), median(lowest))
    return np.asarray(up + (points_enu_m[:, :2] - middle) @ (east, north))
