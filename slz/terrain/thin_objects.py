"""Thin objects among clutter: which isolated returns count, judged from all windows together.

Dust, rain and multipath return single pulses anywhere; a pole, a wire or the wall of a hole returns pulses at
the same place again. Isolated returns are therefore kept, and judged anew with every window. One counts as an
object

- if clutter alone would put that number of others so near with a probability below `FALSE_ALARM`, as in a
  detector of constant false-alarm rate. The share of rays that clutter returns is measured on the lonely
  ones among the isolated returns, and the expected number of others within a distance is that share of the
  rays that passed there; or
- if it is one of a line, see `slz.kernels.points.collinear_returns`; then all places of the line do; or
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

from slz.kernels.points.collinear_returns import LINE_FIELDS, PLACES, follow_lines, points_along
from slz.kernels.points.isolated_returns import BINS, MOST, joined, judge, outcome, place
from slz.kernels.points.nearest_others import FATE, ISOLATED_FIELDS, LEVEL_GROUND, UP
from slz.kernels.points.voxel_density_filter import is_supported
from slz.terrain.tiles import Tiles

LEAST_GROUND, GROUND_VOXEL_M = 2, 1.0  # returns in 3 x 3 voxels that begin ground where none is known
UNKNOWN_PLACE = np.full(3, np.nan)  # of a sensor

Points = NDArray[np.float64]


class ThinObjects:
    """Detector of thin objects.

    Clutter is counted over the present and the previous epoch, each as long as returns are kept: memory and
    time do not grow with the flight.

    Attributes
    ----------
    found_enu_m, altered_enu_m
        (n, 3) returns that count as objects now, and those that do so since the last window or no more; in
        the heights of the evidence.
    """

    def __init__(self) -> None:
        self.found_enu_m: Points = np.empty((0, 3))
        self.altered_enu_m: Points = np.empty((0, 3))
        self._kept: Points = np.empty((0, ISOLATED_FIELDS))
        self._lines = np.empty((0, LINE_FIELDS))
        self._high_share = 0.0  # of the rays, at the heights of an upright object in the highest band
        self._began_s, self._rays = 0.0, [0, 0]  # start of this epoch, and rays of it and the one before
        self._given_up = np.zeros((2, BINS), np.int64)  # lonely returns kept no more, by height, likewise

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
        if now_s - self._began_s > max_age_s:
            self._began_s, self._rays = now_s, [0, self._rays[0]]
            self._given_up = np.stack([np.zeros_like(self._given_up[0]), self._given_up[0]])
        self._rays[0] += n_returns
        kept = self._kept = joined(self._kept, isolated_enu_m[-MOST:], sensor_enu_m, reach_m, now_s)
        points = kept[:, : UP + 1]
        waiting = place(kept, tiles.ground_and_rays(points), now_s, max_age_s, self._high_share)
        if len(waiting):  # without ground below, those that are level with another one are ground
            level = is_supported(points[waiting], UNKNOWN_PLACE, GROUND_VOXEL_M, LEAST_GROUND, 0.0)
            kept[waiting[level], FATE] = LEVEL_GROUND
        high_shares = judge(kept, self._given_up, max(1, sum(self._rays)))
        before, self._lines = self._lines, follow_lines(kept, self._lines.copy())
        self._high_share = float(high_shares.mean()) if len(high_shares) else 0.0
        self.found_enu_m, self.altered_enu_m, surface = outcome(kept)
        if len(before) or len(self._lines):
            step_m = tiles.cell_m
            self.found_enu_m = np.concatenate([self.found_enu_m, points_along(self._lines, step_m)])
            moved = [_others(before, self._lines), _others(self._lines, before)]
            self.altered_enu_m = np.concatenate(
                [self.altered_enu_m, *(points_along(m, step_m) for m in moved)]
            )
        return surface


def _others(lines: Points, beside: Points) -> Points:
    """Return the lines that are elsewhere, or end elsewhere, than all of some others."""
    ends = {line[:PLACES].tobytes() for line in beside}
    return lines[[line[:PLACES].tobytes() not in ends for line in lines]]
