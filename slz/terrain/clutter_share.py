"""Share of the rays that clutter returns, by height over ground."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.points.clutter import HIGH, HIGH_M, LEVEL_M, UPRIGHT_M

MOST_SHARE = 0.02  # of the rays; what returns more is foliage, no clutter
LAYER_M = 2.0  # to each side in height, over which the share is measured
BIN_M, DEEPEST_M, TALLEST_M = 0.25, -50.0, 200.0  # bins of height; what is beyond is in the last one
BINS = round((TALLEST_M - DEEPEST_M) / BIN_M)

Points = NDArray[np.float64]
Counts = NDArray[np.int64]


class ClutterShare:
    """Counts of rays, and of returns of clutter that were given up, of the present and the previous epoch.

    An epoch lasts `epoch_s`; memory and time do not grow with the flight.
    """

    def __init__(self) -> None:
        self._began_s = 0.0
        self._rays = [0, 0]
        self._given_up = np.zeros((2, BINS), np.int64)

    def add_rays(self, n_returns: int, now_s: float, epoch_s: float) -> None:
        """Add the rays of a window."""
        if now_s - self._began_s > epoch_s:
            self._began_s = now_s
            self._rays = [0, self._rays[0]]
            self._given_up = np.stack([np.zeros(BINS, np.int64), self._given_up[0]])
        self._rays[0] += n_returns

    def add_given_up(self, over_m: Points) -> None:
        """Add returns of clutter that are kept no more, by height over ground (n,)."""
        self._given_up[0] += _histogram(over_m)

    def of(self, bands: Counts, over_m: Points, clutter_over_m: Points) -> tuple[Points, Points]:
        """Return the share of rays that clutter returns at the heights of an upright and of a level object.

        Parameters
        ----------
        bands, over_m
            (n,) band and height over ground of the returns in question.
        clutter_over_m
            (m,) heights over ground of the returns kept that are taken for clutter.
        """
        count = _histogram(clutter_over_m) + self._given_up.sum(axis=0)
        below = np.concatenate([[0], np.cumsum(count)])  # returns below each edge of the bins
        edges = np.array([0, _bin(np.array(0.0)), _bin(np.array(HIGH_M)), BINS])
        first, end = edges[bands], edges[bands + 1]
        low = np.maximum(_bin(over_m - LAYER_M), first)
        high = np.minimum(_bin(over_m + LAYER_M) + 1, end)
        rays = max(1, sum(self._rays))
        around = np.minimum((below[high] - below[low] + 1) / rays, MOST_SHARE)
        whole = np.minimum((below[end] - below[first] + 1) / rays, MOST_SHARE)
        upright = np.where(bands == HIGH, around * (UPRIGHT_M / LAYER_M), whole)
        return upright, np.minimum(around * (LEVEL_M / LAYER_M), upright)


def _bin(over_m: Points) -> Counts:
    """Return the bin of each height."""
    return np.clip(np.floor((over_m - DEEPEST_M) / BIN_M), 0, BINS - 1).astype(np.int64)


def _histogram(over_m: Points) -> Counts:
    return np.bincount(_bin(over_m), minlength=BINS)
