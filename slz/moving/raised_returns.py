"""Returns over known ground that its map does not explain: of what moves, or was not seen before."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slz.frame import is_known
from slz.landing_point.local_heights import Nearby
from slz.moving.common_shift import common_shift_m
from slz.window import Scan

LEAST_M, MOST_M = 0.35, 5.0  # over the ground: dogs and grass in the wind, lorries and branches
SIGMAS = 4.0  # of a height at the end of a ray, that noise explains
EVEN_M = 0.4  # between the highest and the lowest of 3 x 3 blocks
LEAST_RANGE_M = 1.5  # of a return; nearer is the vehicle itself, or dust of its rotors
BELOW_M = 3.0  # around the sensor, in which the ground is below it
FAR_M = 1e7  # where returns are put that are nowhere
LOWEST_M = 2.0  # of the sensor over the ground: lower it sees what stands far off at grazing angles
REACH_M = 28.0  # of the sensor over ground; the map beside a report ends at 30 m

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RaisedReturns:
    """Returns (n, 3) in the map frame, their heights (n,) over the ground (m), and their stamps (n,)."""

    points_enu_m: Floats
    over_m: Floats
    stamp_ns: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """Ground and tops of `Nearby`, each top that of the highest block of 3 x 3: edges are not certain.

    even: known blocks among which nothing stands.
    """

    west_m: float
    south_m: float
    cell_m: float
    ground_m: NDArray[np.float32]
    top_m: NDArray[np.float32]
    even: NDArray[np.bool_]

    @classmethod
    def of(cls, nearby: Nearby) -> Ground:
        top = ndimage.maximum_filter(np.nan_to_num(nearby.top_m, nan=-np.inf), size=3, mode="nearest")
        known = np.isfinite(nearby.ground_m)
        tops = np.where(known, top, np.nan).astype(np.float32)
        low = ndimage.minimum_filter(np.where(known, nearby.ground_m, np.inf), size=3, mode="nearest")
        even = known & (top - low < EVEN_M)
        return cls(nearby.west_m, nearby.south_m, nearby.cell_m, nearby.ground_m, tops, even)

    def below_m(self, enu_m: Floats) -> float:
        """Return the median of the ground within `BELOW_M` of a place; where unknown, of all ground."""
        row, col = (
            int((float(enu_m[i]) - corner) // self.cell_m)
            for i, corner in ((1, self.south_m), (0, self.west_m))
        )
        reach = math.ceil(BELOW_M / self.cell_m)
        part = self.ground_m[max(0, row - reach) : row + reach + 1, max(0, col - reach) : col + reach + 1]
        for heights in (part, self.ground_m):
            known = heights[np.isfinite(heights)]
            if len(known):
                return float(np.median(known))
        return math.nan


def raised_returns(scan: Scan, ground: Ground, angle_noise_rad: float) -> RaisedReturns | None:
    """Return the raised returns of a scan; None where there is none, or the sensor's place is unknown or low.

    A return is raised where it is higher over the ground of its block, and over what stands in the blocks
    around, than `LEAST_M` and noise explain. A common shift of all heights is taken off before.
    """
    if not len(scan) or not is_known(scan.sensor_enu_m):
        return None
    if not scan.sensor_enu_m[2] - ground.below_m(scan.sensor_enu_m) > LOWEST_M:
        return None
    finite = np.isfinite(scan.points_enu_m).all(axis=1, keepdims=True)
    points = np.where(finite, scan.points_enu_m, FAR_M)
    col = np.floor((points[:, 0] - ground.west_m) / ground.cell_m).astype(np.intp)
    row = np.floor((points[:, 1] - ground.south_m) / ground.cell_m).astype(np.intp)
    rows, cols = ground.ground_m.shape
    range_m = np.hypot(points[:, 0] - scan.sensor_enu_m[0], points[:, 1] - scan.sensor_enu_m[1])
    here = np.flatnonzero((row >= 0) & (row < rows) & (col >= 0) & (col < cols) & (range_m < REACH_M))
    over = points[here, 2] - ground.ground_m[row[here], col[here]]
    beyond = points[here, 2] - ground.top_m[row[here], col[here]]
    even = ground.even[row[here], col[here]]
    shift_m = common_shift_m(over[even], row[here][even] * cols + col[here][even])
    bound = LEAST_M + SIGMAS * angle_noise_rad * range_m[here] + shift_m
    aside2 = np.einsum("ij,ij->i", points[here] - scan.sensor_enu_m, points[here] - scan.sensor_enu_m)
    raised = (beyond > bound) & (over - shift_m < MOST_M) & (aside2 > LEAST_RANGE_M**2)  # False for NaN
    if not raised.any():
        return None
    which = here[raised]
    return RaisedReturns(points[which], over[raised] - shift_m, scan.stamp_ns[which])
