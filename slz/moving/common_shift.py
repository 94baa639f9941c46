"""Shift and tilt of all ground since the map was made: an error of navigation or of the configured mount."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from slz.kernels.points.over_patch import over_patch
from slz.landing_point.watched_ground import HeightPatch
from slz.points.registration import FEWEST_SPREAD_M, MOST_TILT_RAD, median, robust_plane, wide_axes

FEWEST_CELLS = 30  # of even ground that determine a shift
AGREE_SHARE = 0.5  # of the cells, that agree with a tilt
ROUNDS = 3

Floats = NDArray[np.float64]
Numbers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class OverPatch:
    """Returns over a patch of heights.

    index, cells, heights_m, places_m: (n,) their numbers in the scan, (n,) cells, (n,) heights over those of
    the cells, and (n, 2) east and north. voting: see `common_shift_m`.
    """

    index: Numbers
    cells: Numbers
    heights_m: Floats
    places_m: Floats
    voting: Floats

    @classmethod
    def of(
        cls,
        points_enu_m: Floats,
        patch: HeightPatch,
        heights_m: NDArray[np.float32],
        around: tuple[float, float, float, float],
    ) -> Self:
        """Return those of contiguous points (n, 3) over the heights of a patch.

        around: place, and least and greatest distance from it, of returns on even cells that vote.
        """
        index, cells = np.empty((2, len(points_enu_m)), np.int64)
        over, places, voting = (np.empty((len(points_enu_m), *shape)) for shape in ((), (2,), (3,)))
        n, votes = over_patch(
            points_enu_m, patch.west_m, patch.south_m, patch.cell_m, heights_m, patch.even, around,
            index, cells, places, over, voting,
        )  # fmt: skip
        return cls(index[:n], cells[:n], over[:n], places[:n], voting[:votes])

    def shift_m(self) -> Floats:
        """Return by how much the ground at each return is higher than the patch in common."""
        return common_shift_m(self.places_m, self.voting)


def common_shift_m(places_m: Floats, voting: Floats) -> Floats:
    """Return by how much the ground at each return is higher than the map in common; 0 where too few vote.

    Each cell has one vote, its lowest return: an object returns more than the ground that it covers, and a
    wall more than the street before it. A tilt on which the cells do not agree is none.

    Parameters
    ----------
    places_m, voting
        (n, 2) east and north of returns, and (k, 3) mean place and least height of each cell on even ground
        (`slz.kernels.points.over_patch`).
    """
    if len(voting) < FEWEST_CELLS:
        return np.zeros(len(places_m))
    places, lowest = np.ascontiguousarray(voting[:, :2]), np.ascontiguousarray(voting[:, 2])
    middle = np.add.reduce(places) / len(places)
    places -= middle
    axes = wide_axes(places, FEWEST_SPREAD_M)
    (up, east, north), share = robust_plane(places, lowest, axes, ROUNDS)
    if share < AGREE_SHARE or np.hypot(east, north) > MOST_TILT_RAD:
        return np.full(len(places_m), median(lowest))
    return np.asarray(up + (places_m - middle) @ (east, north))
