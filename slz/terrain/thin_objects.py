"""Thin objects among clutter: which isolated returns count, judged from all windows together.

Dust, rain and multipath return single pulses anywhere; a pole, a wire or the wall of a hole returns pulses at
the same place again. Isolated returns are therefore kept, and judged anew with every window. One counts as an
object

- if clutter alone would put that number of others so near with a probability below `FALSE_ALARM`, as in a
  detector of constant false-alarm rate. The share of rays that clutter returns is measured on the lonely
  ones among the isolated returns, and the expected number of others within a distance is that share of the
  rays that passed there; or
- if it is within `SMALL_M` of the ground, where real objects are, and an object of `HAZARD_M` would have
  returned fewer than `CONTRADICTING` pulses by now. More rays without a second return contradict it.

The probability of a false alarm is that of one number of others within one distance. Up to two are tested
near the ground and twelve above `HIGH_M`, so 1 % of the returns of clutter count as objects by the first
rule, whatever their density. The verdict depends on all returns and not on how they are cut into windows, and
later rays withdraw it.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from slz.kernels.points.clutter import HIGH, HIGH_M, LEVEL_M, LONELY_M, NO_BAND, UPRIGHT_M, chances
from slz.kernels.points.voxel_density_filter import is_supported
from slz.terrain.isolated_returns import IsolatedReturns
from slz.terrain.tiles import Tiles

FALSE_ALARM = np.array([0.005, 0.005, 0.0008])  # below ground, low, high
MOST_SHARE = 0.02  # of the rays; what returns more is foliage, no clutter
LAYER_M = 2.0  # to each side in height, over which the share of clutter is measured
AGREES_M = 0.15  # from the ground: belongs to it
SMALL_M, HAZARD_M, CONTRADICTING = 0.5, 0.3, 5
LEAST_GROUND, GROUND_VOXEL_M = 2, 1.0  # returns in 3 x 3 voxels that begin ground where none is known
UNKNOWN_PLACE = np.full(3, np.nan)  # of a sensor
SOLID = 5  # returns within `LONELY_M`, level and upright, that are an object for good
SMALLEST_M2, SURE = 0.005, 5  # what is no object: 5 pulses of one of 5 x 10 cm would have returned

Points = NDArray[np.float64]
Flags = NDArray[np.bool_]


class ThinObjects:
    """Detector of thin objects.

    Attributes
    ----------
    found_enu_m, altered_enu_m
        (n, 3) returns that count as objects now, and those that do so since the last window or no more; in
        the heights of the evidence.
    """

    def __init__(self) -> None:
        self.found_enu_m: Points = np.empty((0, 3))
        self.altered_enu_m: Points = np.empty((0, 3))
        self._high_share = 0.0  # of the rays, at the heights of an upright object in the highest band
        self._kept = IsolatedReturns.none()
        # Stamp, number of returns, and heights over ground of lonely ones that were contradicted.
        self._windows: deque[tuple[float, int, Points]] = deque()

    def update(
        self, isolated_enu_m: Points, sensor_enu_m: Points, n_returns: int, tiles: Tiles, max_age_s: float
    ) -> Points:
        """Add a window's isolated returns and judge all anew; return those that belong to the surface.

        These are on the ground, or on an object of many returns; they are evidence like any other.

        Parameters
        ----------
        isolated_enu_m, sensor_enu_m
            (n, 3) isolated returns and (3,) position of the sensor, in the heights of the evidence.
        n_returns
            Number of returns of the window.
        tiles
            Evidence, the window's other returns included.
        max_age_s
            Time after which a return is forgotten.
        """
        now_s = tiles.latest_s
        while self._windows and self._windows[0][0] < now_s - max_age_s:
            self._windows.popleft()
        new = IsolatedReturns.new(isolated_enu_m, now_s, float(sensor_enu_m[2]))
        kept = self._kept.joined_with(new)
        stays = (now_s - kept.born_s <= max_age_s) & kept.within_limit()
        self.altered_enu_m = kept.some(~stays).found_enu_m
        kept = kept.some(stays)
        over_m, held_m2 = tiles.ground_and_rays(kept.points_enu_m).T
        kept.count_rays(held_m2)
        on_ground = np.abs(over_m) <= AGREES_M
        ground: Points = kept.points_enu_m[on_ground]
        self.altered_enu_m = np.concatenate([self.altered_enu_m, kept.some(on_ground).found_enu_m])
        kept, over_m = kept.some(~on_ground), over_m[~on_ground]
        kept.place(over_m, self._high_share)
        placed = kept.bands != NO_BAND
        others, over_m = kept.some(~placed), over_m[placed]
        kept = kept.some(placed)
        # Without ground below, returns are over unknown ground, which is never safe; level ones are ground.
        level = is_supported(others.points_enu_m, UNKNOWN_PLACE, GROUND_VOXEL_M, LEAST_GROUND, 0.0)
        ground = np.concatenate([ground, others.points_enu_m[level]])
        others = others.some(~level)
        self._windows.append((now_s, n_returns, np.empty(0)))
        certain = self._chance(kept, over_m) < FALSE_ALARM[kept.bands]
        small = (np.abs(over_m) < SMALL_M) & (kept.rays_m2 * HAZARD_M**2 < CONTRADICTING)
        near_m = np.maximum(kept.upright_m, kept.level_m)[:, SOLID - 2]
        solid = certain & (near_m <= LONELY_M)
        contradicted = ~(certain | small) & (kept.rays_at_height_m2(over_m) * SMALLEST_M2 >= SURE)
        self._windows[-1] = now_s, n_returns, over_m[contradicted & kept.lonely]
        found = (certain | small) & ~solid
        self.found_enu_m = kept.points_enu_m[found]
        self.altered_enu_m = np.concatenate([self.altered_enu_m, kept.points_enu_m[found != kept.found]])
        kept.found = found
        surface: Points = np.concatenate([ground, kept.points_enu_m[solid]])
        self._kept = others.joined_with(kept.some(~(contradicted | solid)))
        return surface

    def _chance(self, kept: IsolatedReturns, over_m: Points) -> Points:
        """Return the probability that clutter alone puts the others so near to each return."""
        clutter_m = np.sort(
            np.concatenate([over_m[kept.lonely], *(gone_m for _, _, gone_m in self._windows)])
        )
        upright, level = self._shares(kept.bands, over_m, clutter_m)
        high = kept.bands == HIGH
        self._high_share = float(upright[high].mean()) if high.any() else 0.0
        rays_m2 = kept.rays_at_height_m2(over_m)
        return chances(kept.upright_m, kept.level_m, ~high, rays_m2, upright, level)

    def _shares(self, bands: NDArray[np.int64], over_m: Points, clutter_m: Points) -> tuple[Points, Points]:
        """Return the share of rays that clutter returns at the heights of an upright and of a level object.

        clutter_m: heights over ground of the returns taken for clutter, ascending.
        """
        rays = max(1, sum(n for _, n, _ in self._windows))
        edges = np.searchsorted(clutter_m, [-np.inf, 0.0, HIGH_M, np.inf])  # first of each band, and the end
        first, end = edges[bands], edges[bands + 1]
        low = np.maximum(np.searchsorted(clutter_m, over_m - LAYER_M), first)
        high = np.minimum(np.searchsorted(clutter_m, over_m + LAYER_M), end)
        around = np.minimum((high - low + 1) / rays, MOST_SHARE)
        whole = np.minimum((end - first + 1) / rays, MOST_SHARE)
        upright = np.where(bands == HIGH, around * (UPRIGHT_M / LAYER_M), whole)
        return upright, np.minimum(around * (LEVEL_M / LAYER_M), upright)
