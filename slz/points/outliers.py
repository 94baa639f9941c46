"""Vertical outlier removal by histogram (SLZ paper 3.2.1, SLZ thesis 3.3.1.1).

The sources' rule, by the population of the histogram's end bins, is that of `point_pass`; these are
the safer ones of default mode: heights beyond an empty gap, returns without company.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from slz.kernels.points.histogram import gaps_of
from slz.kernels.points.voxel_density_filter import has_company

COMPANY = 2
OBJECT_M2 = 0.005  # 5 x 10 cm: the least that must not be taken for dust
CLOUD_GROUP = (1.5, 3)  # metres, returns: a wire, a mast's top, a shaft's bottom
FLIGHT_GROUP = (0.6, 5)  # the least object to be seen, 0.5 x 0.3 m with 5 pulses; echoes lie farther apart
RECENT, OFTEN, PLACE_M = 12, 5, 0.4


def gap_interval(
    height_m: NDArray[np.float64], gap_m: float, max_share: float = 0.002
) -> tuple[float, float]:
    """Return the accepted heights by the safer rule: only few points beyond an empty gap are outliers.

    A building of any height is joined to the ground by wall returns or holds many points; a valley floor
    likewise. A ghost is alone: fewer than `max_share` of the points, beyond `gap_m` without any return.

    Parameters
    ----------
    height_m
        (n,) heights, metres.
    gap_m
        Least height without returns that sets outliers apart.
    max_share
        Greatest share of points that may be dropped at each end.
    """
    if not len(height_m):
        return -np.inf, np.inf
    return gaps_of(np.ascontiguousarray(height_m), gap_m, max_share)


def in_a_group(points_enu_m: NDArray[np.float64], radius_m: float, least: int) -> NDArray[np.bool_]:
    """Tell which of the points beyond a gap lie with so many, themselves included, within a radius.

    A wire, a mast, a shaft: where these do they are no strays, however few they are among all returns.
    """
    if not len(points_enu_m):
        return np.zeros(0, bool)
    tree = cKDTree(points_enu_m)
    return np.asarray(tree.query_ball_point(points_enu_m, radius_m, return_length=True) >= least)


def in_company(
    points_enu_m: NDArray[np.float64], sensor_enu_m: NDArray[np.float64], cell_m: float
) -> NDArray[np.bool_]:
    """Tell of every return of a window whether it is not alone.

    Rain, dust and multi-path returns float alone; ground and whatever stands on it is hit again and again,
    the more the nearer it is. A return counts as alone when fewer others lie around it than an object of
    `OBJECT_M2` would send back at that range, had the sensor spread its pulses over the whole sphere: they
    are sought in a slab of 3 x 3 voxels of 1.5 cells (0.3 m at least), 0.75 voxels high, so that the ground
    is no company of an echo 0.15 m below it. Where that number is below `COMPANY`, so many must lie in a
    block 3.75 voxels high, and not one only close below a surface of many. Ground sampled so sparsely is
    dropped too, and stays unknown. Where most returns are alone, being alone says nothing, and all are kept.

    Parameters
    ----------
    points_enu_m
        (n, 3) returns of one window, finite.
    sensor_enu_m
        (3,) where the sensor was; NaN where that is not known.
    """
    if not len(points_enu_m):
        return np.ones(0, bool)
    points = np.ascontiguousarray(points_enu_m)
    keep = has_company(points, sensor_enu_m, max(0.3, 1.5 * cell_m), COMPANY, OBJECT_M2)
    return keep if keep.mean() > 0.5 else np.ones(len(keep), bool)


class LoneReturns:
    """Remembers returns that were alone: something thin may send back one in every window.

    A lone return counts when `OFTEN` windows of the last `RECENT`, this one among them, had one within
    `PLACE_M` of it; those before it then count too. Dust is elsewhere in the next window. Near the sensor,
    where an object would send back several, and where dust is dense, none counts.
    """

    def __init__(self) -> None:
        self._windows: deque[cKDTree] = deque(maxlen=RECENT - 1)

    def returning(
        self, lone_enu_m: NDArray[np.float64], sensor_enu_m: NDArray[np.float64], n_returns: int
    ) -> NDArray[np.float64]:
        """Take the lone returns of a window of so many returns; return (m, 3) those that count now."""
        way = lone_enu_m - sensor_enu_m
        expected = OBJECT_M2 * n_returns / (4 * np.pi) / np.maximum(np.einsum("ij,ij->i", way, way), 1e-2)
        lone = lone_enu_m[expected <= COMPANY]
        before = [tree for tree in self._windows if tree.n]
        self._windows.append(cKDTree(lone))
        if not len(lone) or len(before) < OFTEN - 1:
            return np.empty((0, 3))
        near = [tree.query(lone, distance_upper_bound=PLACE_M) for tree in before]
        seen = np.array([np.isfinite(distance) for distance, _ in near])
        often = seen.sum(axis=0) >= OFTEN - 1
        again = [
            tree.data[np.unique(np.asarray(index)[often & np.isfinite(distance)])]
            for tree, (distance, index) in zip(before, near, strict=True)
        ]
        return np.vstack([lone[often], *again])
