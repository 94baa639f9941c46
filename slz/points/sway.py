"""Sway of a window: how far its scans are off from one another, by navigation errors that change within it.

The height that an autopilot estimates sways by a decimetre within a second (PX4), and its attitude by half a
degree. A window of two seconds would hold level ground at all these heights. Each scan is registered by
itself to the map below it, after the window as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.kernels.points.repeatability import rows_by_span
from slz.points.registration import FEWEST_SPREAD_M, median, robust_plane, wide_axes
from slz.points.solid_ground import SolidGround
from slz.terrain.tiles import Tiles

Floats = NDArray[np.float64]
Scans = NDArray[np.uint16]
MOST_SPANS = 40  # of a window; more scans are taken together
PER_SPAN = 200  # returns compared with the map: their mean is better than two millimetres
FEWEST_RETURNS = 60
KNOWN_SHARE = 0.5  # share of a span's returns over solid ground from which its tilt is estimated
AGREE_SHARE = 0.5  # of them, that agree with the fit
LEAST_M = 0.01  # standard deviation of the spans' heights that is no noise
LEAST_VIEW_M = 1.0  # standard deviation of the places; a line or a narrow view may be filled by an object
MOST_M, MOST_TILT_RAD = 0.2, np.radians(2.0)  # what moves a span by more is an object that fills its view
MOST_STEP_M = 0.05  # from span to span; a vehicle sways by 0.03 m in a tenth of a second
ROUNDS = 3
BOTH, NEITHER = np.eye(2), np.empty((2, 0))  # axes along which a slope is fitted


@dataclass(frozen=True, slots=True)
class Sway:
    """Offsets of spans of a window over the map.

    offsets: (k, 3), at the sensor (m), and per metre to the east and to the north. origins_enu_m: (k, 3), the
    sensor's position. of_scan: the span of each scan.
    """

    offsets: Floats
    origins_enu_m: Floats
    of_scan: NDArray[np.intp]

    def removed_from(self, points_enu_m: Floats, scan: Scans) -> Floats:
        """Return points (n, 3) without the offset of their scan (n,)."""
        if not self.offsets.any():
            return points_enu_m
        span = self.of_scan[scan]
        out, off = points_enu_m.copy(), self.offsets[span]
        way = np.nan_to_num(
            points_enu_m[:, :2] - self.origins_enu_m[span, :2]
        )  # no tilt about an unknown place
        out[:, 2] -= off[:, 0] + off[:, 1] * way[:, 0] + off[:, 2] * way[:, 1]
        return out


def sway(
    points_enu_m: Floats,
    used: NDArray[np.intp],
    scan: Scans,
    origins_enu_m: Floats,
    tiles: Tiles,
    ground: SolidGround,
) -> Sway:
    """Return the sway of a window that is registered as a whole; none where it is no more than noise.

    A span that too little of the map is below has the sway of its neighbours. Where a span steps from the one
    before, something came into its view, and the window is taken as it is.

    Parameters
    ----------
    points_enu_m, used
        (n, 3) in stored heights, and (m,) indices of those to use.
    scan, origins_enu_m
        (n,) scan of each point, (k, 3) position of the sensor in each.
    ground
        Solid ground below the window, which alone is compared.
    """
    n_scans = len(origins_enu_m)
    if n_scans < 2:
        return Sway(np.zeros((n_scans, 3)), origins_enu_m, np.zeros(n_scans, np.intp))
    n = min(n_scans, MOST_SPANS)
    of_scan = np.arange(n_scans) * n // max(1, n_scans)
    origins = origins_enu_m[np.searchsorted(of_scan, np.arange(n))]
    offsets = np.zeros((n, 3))
    found, span, known = _compared(points_enu_m, used, scan, of_scan, n, tiles, ground)
    ends = np.searchsorted(span, np.arange(n + 1))
    usable = np.flatnonzero(np.diff(ends) >= FEWEST_RETURNS)
    heights = [median(found[ends[k] : ends[k + 1], 2]) for k in usable]
    if len(usable) < 2 or np.std(heights) < LEAST_M:
        return Sway(offsets, origins, of_scan)
    good = []
    for k in usable:
        own = found[ends[k] : ends[k + 1]]
        places = own[:, :2] - origins[k, :2]
        if not np.isfinite(places).all() or wide_axes(places, LEAST_VIEW_M).shape[1] < 2:
            continue  # the sensor's position is unknown, or an object may fill the view
        is_tilted = known[k] >= KNOWN_SHARE and wide_axes(places, FEWEST_SPREAD_M).shape[1] == 2
        offset, share = robust_plane(places, own[:, 2], BOTH if is_tilted else NEITHER, ROUNDS)
        if share >= AGREE_SHARE and abs(offset[0]) <= MOST_M and np.hypot(*offset[1:]) <= MOST_TILT_RAD:
            offsets[k] = offset
            good.append(k)
    steps = np.abs(np.diff(offsets[good, 0])) > MOST_STEP_M * np.diff(good)
    if not good or steps.any():
        offsets[:] = 0
    else:
        for column in offsets.T:
            column[:] = np.interp(np.arange(n), good, column[good])
    return Sway(offsets, origins, of_scan)


def _compared(
    points_enu_m: Floats,
    used: NDArray[np.intp],
    scan: Scans,
    of_scan: NDArray[np.intp],
    n: int,
    tiles: Tiles,
    ground: SolidGround,
) -> tuple[Floats, NDArray[np.intp], Floats]:
    """Return what `Tiles.differences` says of returns over solid ground of each span in turn: (m, 4).

    Then their spans (m,), and the share of each span's returns that are over solid ground (n,).
    """
    blocks = ground.west_m, ground.south_m, ground.side_m, ground.blocks
    rows, span, count = rows_by_span(points_enu_m, used, scan, of_scan, n, PER_SPAN, *blocks)
    found = tiles.differences(points_enu_m, rows)
    return found, span[found[:, 3].astype(np.intp)], count[1] / np.maximum(count[0], 1)
