"""Sway of a window: what its scans are off from one another, by navigation errors that change within it.

The height that an autopilot estimates sways by a decimetre within a second (PX4), and its attitude by half a
degree. A window of two seconds would hold level ground at all these heights. Each scan is registered by
itself to the map below it, after the window as a whole.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.points.registration import FEWEST_SPREAD_M, median, robust_plane
from slz.terrain.tiles import Tiles

Floats = NDArray[np.float64]
Scans = NDArray[np.uint16]
PER_SCAN = 200  # returns of a scan compared with the map: their mean is better than two millimetres
FEWEST_RETURNS = 60
KNOWN_SHARE = 0.5  # of a scan's returns over known ground, from which on its tilt is told
AGREE_SHARE = 0.5  # of them, that agree with the fit
LEAST_M = 0.01  # standard deviation of the scans' heights that is no noise
MOST_TILT_RAD = np.radians(2.0)
ROUNDS = 3


@dataclass(frozen=True, slots=True)
class Sway:
    """Offsets of scans over the map: (k, 3), at the sensor (m), and per metre to the east and to the north.

    origins_enu_m: (k, 3), the sensor's position in each scan.
    """

    offsets: Floats
    origins_enu_m: Floats

    def removed_from(self, points_enu_m: Floats, scan: Scans) -> Floats:
        """Return points (n, 3) without the offset of their scan (n,)."""
        if not self.offsets.any():
            return points_enu_m
        out, off = points_enu_m.copy(), self.offsets[scan]
        way = points_enu_m[:, :2] - self.origins_enu_m[scan, :2]
        out[:, 2] -= off[:, 0] + off[:, 1] * way[:, 0] + off[:, 2] * way[:, 1]
        return out


def sway(
    points_enu_m: Floats,
    used: NDArray[np.intp],
    scan: Scans,
    origins_enu_m: Floats,
    tiles: Tiles,
    most_m: float,
) -> Sway:
    """Return the sway of a window that is registered as a whole; none where it is no more than noise.

    A scan that too little of the map is below has the sway of its neighbours.

    Parameters
    ----------
    points_enu_m, used
        (n, 3) in stored heights, and (m,) indices of those to use.
    scan, origins_enu_m
        (n,) scan of each point, (k, 3) position of the sensor in each.
    most_m
        Bound on a shift in height.
    """
    none = Sway(np.zeros((len(origins_enu_m), 3)), origins_enu_m)
    found, of_scan, compared = _compared(points_enu_m, used, scan, len(origins_enu_m), tiles)
    ends = np.searchsorted(of_scan, np.arange(len(origins_enu_m) + 1))
    told = np.flatnonzero(np.diff(ends) >= FEWEST_RETURNS)
    heights = [median(found[ends[k] : ends[k + 1], 2]) for k in told]
    if len(told) < 2 or np.std(heights) < LEAST_M:
        return none
    offsets, good = none.offsets.copy(), []
    for k in told:
        own = found[ends[k] : ends[k + 1]]
        places = own[:, :2] - origins_enu_m[k, :2]
        level = len(own) < KNOWN_SHARE * compared[k] or bool((places.std(axis=0) < FEWEST_SPREAD_M).any())
        offset, share = robust_plane(places, own[:, 2], level, ROUNDS)
        if share >= AGREE_SHARE and abs(offset[0]) <= most_m and np.hypot(*offset[1:]) <= MOST_TILT_RAD:
            offsets[k] = offset
            good.append(k)
    if not good:
        return none
    for column in offsets.T:
        column[:] = np.interp(np.arange(len(offsets)), good, column[good])
    return Sway(offsets, origins_enu_m)


def _compared(
    points_enu_m: Floats, used: NDArray[np.intp], scan: Scans, n_scans: int, tiles: Tiles
) -> tuple[Floats, Scans, NDArray[np.intp]]:
    """Return what `Tiles.differences` says of returns of each scan in turn: (m, 4).

    Then their scans (m,), and how many of each scan were compared (k,).
    """
    order = used[np.argsort(scan[used], kind="stable")]
    ends = np.searchsorted(scan[order], np.arange(n_scans + 1))
    parts = [order[a:b][:: max(1, (b - a) // PER_SCAN)] for a, b in itertools.pairwise(ends.tolist())]
    some = np.concatenate(parts)
    found = tiles.differences(points_enu_m[some])
    return found, scan[some[found[:, 3].astype(np.intp)]], np.array([len(part) for part in parts])
