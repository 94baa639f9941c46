"""Isolated returns kept from window to window, and what the evidence says of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.column_table import ColumnTable
from slz.kernels.points.clutter import (
    HIGH,
    LONELY_LEVEL_M,
    MOST_OTHERS,
    NO_BAND,
    OPAQUE,
    REACH_M,
    add_others,
    bands_of,
)

MOST = 8192  # returns kept
EXPLAINED = 2.0  # returns of clutter expected, among which `MOST_OTHERS` are no object

Points = NDArray[np.float64]


@dataclass(slots=True)
class IsolatedReturns(ColumnTable):
    """Isolated returns of several windows.

    held_m2: rays per m² that the cells around hold; rays_m2: the same, with those that the cells forgot.
    upright_m, level_m, lonely: see `slz.kernels.points.clutter.add_others`.
    """

    number: NDArray[np.int64]  # of each return, in the order of the windows
    points_enu_m: Points
    born_s: Points
    sensor_up_m: Points
    distant: NDArray[np.bool_]  # beyond the reach of the map
    held_m2: Points
    rays_m2: Points
    bands: NDArray[np.int64]
    upright_m: Points
    level_m: Points
    lonely: NDArray[np.bool_]
    found: NDArray[np.bool_]  # counts as an object since the last window

    def __len__(self) -> int:
        return len(self.born_s)

    def not_in(self, other: IsolatedReturns) -> Points:
        """Return the points (m, 3) of the returns that are not among others."""
        return self.points_enu_m[~np.isin(self.number, other.number)]

    def within_limit(self) -> NDArray[np.bool_]:
        """Return which returns to keep: `MOST`; the oldest that do not count as objects go first."""
        order = np.lexsort((self.number, self.found))
        stays = np.ones(len(self), bool)
        stays[order[: max(0, len(self) - MOST)]] = False
        return stays

    @classmethod
    def none(cls) -> IsolatedReturns:
        """Return no returns."""
        return cls.new(np.empty((0, 3)), 0.0, 0.0, 0)

    @classmethod
    def new(
        cls,
        points_enu_m: Points,
        now_s: float,
        sensor_up_m: float,
        first: int,
        distant: NDArray[np.bool_] | None = None,
    ) -> IsolatedReturns:
        """Return the returns of a window, numbered from `first` on, before anything is known of them.

        distant: (n,) which are beyond the reach of the map; none by default.
        """
        n = len(points_enu_m)
        upright_m, level_m = np.full((2, n, MOST_OTHERS), np.inf)
        return cls(
            number=np.arange(first, first + n),
            points_enu_m=points_enu_m,
            born_s=np.full(n, now_s),
            sensor_up_m=np.full(n, sensor_up_m),
            distant=np.zeros(n, bool) if distant is None else distant,
            held_m2=np.zeros(n),
            rays_m2=np.zeros(n),
            bands=np.full(n, NO_BAND),
            upright_m=upright_m,
            level_m=level_m,
            lonely=np.ones(n, bool),
            found=np.zeros(n, bool),
        )

    def count_rays(self, held_m2: Points) -> None:
        """Add the rays since the last call, from what the cells around hold now."""
        self.rays_m2 = self.rays_m2 + np.maximum(held_m2 - self.held_m2, 0)
        self.held_m2 = held_m2

    def place(self, over_m: Points, high_share: float) -> None:
        """Give a band to the returns whose ground is known now, and make them others of all.

        high_share: clutter of a ray at the heights of an upright object in the highest band, as last known.
        """
        new = (self.bands == NO_BAND) & ~np.isnan(over_m)
        if not new.any():
            return
        self.bands = np.where(new, bands_of(over_m), self.bands)
        # Farther others make no object: an opaque one has more returns, and clutter explains so many.
        rays_m2 = np.maximum(self.rays_at_height_m2(over_m), 1e-3)
        most = np.where(self.bands == HIGH, EXPLAINED / max(high_share, 1e-6), (MOST_OTHERS + 1) / OPAQUE)
        reach_m = np.clip(np.sqrt(most / (np.pi * rays_m2)), LONELY_LEVEL_M, REACH_M)
        add_others(self.points_enu_m, self.bands, new, reach_m, self.upright_m, self.level_m, self.lonely)

    def rays_at_height_m2(self, over_m: Points) -> Points:
        """Return the rays per m² that passed at the height of each return; rays diverge downwards."""
        down_m = np.maximum(self.sensor_up_m - self.points_enu_m[:, 2], 1.0)
        return self.rays_m2 * np.where(over_m > 0, ((down_m + over_m) / down_m) ** 2, 1.0)
