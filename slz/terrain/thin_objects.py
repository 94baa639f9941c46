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

import numpy as np
from numpy.typing import NDArray

from slz.kernels.points.clutter import HIGH, LONELY_M, NO_BAND, chances
from slz.kernels.points.voxel_density_filter import is_supported
from slz.terrain.clutter_share import ClutterShare
from slz.terrain.isolated_returns import IsolatedReturns
from slz.terrain.tiles import Tiles

FALSE_ALARM = np.array([0.005, 0.005, 0.0008])  # below ground, low, high
AGREES_M = 0.15  # from the ground: belongs to it
DISTANT_M = 0.3  # from the ground, up to which a distant return may belong to it
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
        self._kept, self._n_added = IsolatedReturns.none(), 0
        self._share = ClutterShare()

    def update(
        self,
        isolated_enu_m: Points,
        sensor_enu_m: Points,
        n_returns: int,
        tiles: Tiles,
        max_age_s: float,
        reach_m: float,
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
        reach_m
            Horizontal distance up to which returns are precise enough to be ground.
        """
        now_s = tiles.latest_s
        self._share.add_rays(n_returns, now_s, max_age_s)
        before = self._kept.some(self._kept.found)
        distant = np.hypot(*(isolated_enu_m - sensor_enu_m)[:, :2].T) > reach_m
        new = IsolatedReturns.new(isolated_enu_m, now_s, float(sensor_enu_m[2]), self._n_added, distant)
        self._n_added += len(new)
        kept = self._kept.joined_with(new.some(new.within_limit()))
        kept = kept.some(now_s - kept.born_s <= max_age_s)
        over_m, held_m2 = tiles.ground_and_rays(kept.points_enu_m).T
        kept.count_rays(held_m2)
        apart = ~kept.distant | (np.abs(over_m) > DISTANT_M)  # False for a distant one over unknown ground
        kept, over_m = kept.some(apart), over_m[apart]
        on_ground = np.abs(over_m) <= AGREES_M
        ground, kept, over_m = kept.points_enu_m[on_ground], kept.some(~on_ground), over_m[~on_ground]
        kept.place(over_m, self._high_share)
        placed = kept.bands != NO_BAND
        others = kept.some(~placed)
        level = _begins_ground(others.points_enu_m)
        solid, kept = self._judged(kept.some(placed), over_m[placed])
        found = kept.some(kept.found)
        self.found_enu_m = found.points_enu_m
        self.altered_enu_m = np.concatenate([before.not_in(found), found.not_in(before)])
        self._kept = others.some(~level).joined_with(kept)
        surface: Points = np.concatenate([ground, others.points_enu_m[level], solid])
        return surface

    def _judged(self, kept: IsolatedReturns, over_m: Points) -> tuple[Points, IsolatedReturns]:
        """Return the returns of solid objects, and those to keep with their verdicts."""
        certain = self._chance(kept, over_m) < FALSE_ALARM[kept.bands]
        small = (np.abs(over_m) < SMALL_M) & ~kept.distant & (kept.rays_m2 * HAZARD_M**2 < CONTRADICTING)
        near_m = np.maximum(kept.upright_m, kept.level_m)[:, SOLID - 2]
        solid = certain & (near_m <= LONELY_M)
        kept.found = certain | small
        contradicted = ~kept.found & (kept.rays_at_height_m2(over_m) * SMALLEST_M2 >= SURE)
        stays = ~(contradicted | solid)
        stays[stays] = kept.some(stays).within_limit()
        self._share.add_given_up(over_m[~stays & ~solid & kept.lonely])
        return kept.points_enu_m[solid], kept.some(stays)

    def _chance(self, kept: IsolatedReturns, over_m: Points) -> Points:
        """Return the probability that clutter alone puts the others so near to each return."""
        upright, level = self._share.of(kept.bands, over_m, over_m[kept.lonely])
        high = kept.bands == HIGH
        self._high_share = float(upright[high].mean()) if high.any() else 0.0
        rays_m2 = kept.rays_at_height_m2(over_m)
        return chances(kept.upright_m, kept.level_m, ~high, rays_m2, upright, level)


def _begins_ground(points_enu_m: Points) -> Flags:
    """Return which returns without ground below them are level with another one, and so are ground."""
    return is_supported(points_enu_m, UNKNOWN_PLACE, GROUND_VOXEL_M, LEAST_GROUND, 0.0)
