"""Isolated returns kept from window to window, and what the evidence says of each."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from slz.kernels.points.clutter import MOST_OTHERS, NO_BAND, add_others, bands_of

MOST = 8192  # returns kept; the oldest go first

Points = NDArray[np.float64]


@dataclass(slots=True)
class IsolatedReturns:
    """Isolated returns, in the order of their windows.

    held_m2: rays per m² that the cells around hold; rays_m2: the same, with those that the cells forgot.
    upright_m, level_m, lonely: see `slz.kernels.points.clutter.add_others`.
    """

    points_enu_m: Points
    born_s: Points
    sensor_up_m: Points
    held_m2: Points
    rays_m2: Points
    bands: NDArray[np.int64]
    upright_m: Points
    level_m: Points
    lonely: NDArray[np.bool_]

    @classmethod
    def none(cls) -> IsolatedReturns:
        """Return no returns."""
        return cls.new(np.empty((0, 3)), 0.0, 0.0)

    @classmethod
    def new(cls, points_enu_m: Points, now_s: float, sensor_up_m: float) -> IsolatedReturns:
        """Return the returns of a window, of which nothing is known yet."""
        n = len(points_enu_m)
        upright_m, level_m = np.full((2, n, MOST_OTHERS), np.inf)
        return cls(
            points_enu_m=points_enu_m,
            born_s=np.full(n, now_s),
            sensor_up_m=np.full(n, sensor_up_m),
            held_m2=np.zeros(n),
            rays_m2=np.zeros(n),
            bands=np.full(n, NO_BAND),
            upright_m=upright_m,
            level_m=level_m,
            lonely=np.ones(n, bool),
        )

    def with_new(self, points_enu_m: Points, now_s: float, sensor_up_m: float) -> IsolatedReturns:
        """Return these and those of a new window, `MOST` at the most."""
        return self.joined_with(IsolatedReturns.new(points_enu_m, now_s, sensor_up_m))

    def joined_with(self, other: IsolatedReturns) -> IsolatedReturns:
        """Return these and others, the last `MOST`."""
        return IsolatedReturns(
            *(np.concatenate([getattr(self, f.name), getattr(other, f.name)])[-MOST:] for f in fields(self))
        )

    def some(self, which: NDArray[np.bool_]) -> IsolatedReturns:
        """Return some of the returns."""
        return self if which.all() else IsolatedReturns(*(getattr(self, f.name)[which] for f in fields(self)))

    def count_rays(self, held_m2: Points) -> None:
        """Add the rays since the last call, from what the cells around hold now."""
        self.rays_m2 = self.rays_m2 + np.maximum(held_m2 - self.held_m2, 0)
        self.held_m2 = held_m2

    def place(self, over_m: Points) -> None:
        """Give a band to the returns whose ground is known now, and make them others of all."""
        new = (self.bands == NO_BAND) & ~np.isnan(over_m)
        if new.any():
            self.bands = np.where(new, bands_of(over_m), self.bands)
            add_others(
                self.points_enu_m, self.bands, new, self.rays_m2, self.upright_m, self.level_m, self.lonely
            )

    def rays_at_height_m2(self, over_m: Points) -> Points:
        """Return the rays per m² that passed at the height of each return; rays diverge downwards."""
        down_m = np.maximum(self.sensor_up_m - self.points_enu_m[:, 2], 1.0)
        return self.rays_m2 * np.where(over_m > 0, ((down_m + over_m) / down_m) ** 2, 1.0)
