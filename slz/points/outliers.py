"""Outlier removal in default mode: heights beyond an empty gap, and isolated returns.

These rules are safer than the sources' histogram rule, which trims sparse end bins (SLZ paper, section 3.2.1;
SLZ thesis, section 3.3.1.1): see `slz.kernels.paper.height_gate`.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from slz.kernels.points.histogram import gaps_of
from slz.kernels.points.voxel_density_filter import is_supported

LEAST_SUPPORT = 2
OBJECT_M2 = 0.005  # 5 x 10 cm: the smallest object that must not be removed as dust
CLOUD_GROUP = (1.5, 3)  # metres, returns: a wire, a mast's top, a shaft's bottom
FLIGHT_GROUP = (0.6, 5)  # the smallest object to detect, 0.5 x 0.3 m with 5 pulses; echoes are farther apart
RECENT, OFTEN, PLACE_M = 12, 5, 0.4


def gap_interval(
    height_m: NDArray[np.float64], gap_m: float, max_share: float = 0.002
) -> tuple[float, float]:
    """Return the interval of accepted heights: only few points beyond an empty gap are outliers.

    A building of any height is joined to the ground by wall returns or holds many points; a valley floor
    likewise. Ghosts are rare and isolated: fewer than `max_share` of the points, beyond `gap_m` without a
    return.

    Parameters
    ----------
    height_m
        (n,) heights, metres.
    gap_m
        Least height without returns that separates outliers.
    max_share
        Greatest share of points that may be dropped at each end.
    """
    if not len(height_m):
        return -np.inf, np.inf
    return gaps_of(np.ascontiguousarray(height_m), gap_m, max_share)


def in_cluster(points_enu_m: NDArray[np.float64], radius_m: float, least: int) -> NDArray[np.bool_]:
    """Return which points have at least `least` points within a radius, themselves included.

    Among the points beyond a gap these are a wire, a mast or a shaft: no outliers, however few they are.
    """
    if not len(points_enu_m):
        return np.zeros(0, bool)
    tree = cKDTree(points_enu_m)
    return np.asarray(tree.query_ball_point(points_enu_m, radius_m, return_length=True) >= least)


def not_isolated(
    points_enu_m: NDArray[np.float64], sensor_enu_m: NDArray[np.float64], cell_m: float
) -> NDArray[np.bool_]:
    """Return which returns of a window are not isolated.

    Rain, dust and multipath returns are isolated; ground and objects are hit repeatedly, more often at short
    range. A return is isolated when fewer others are around it than an object of `OBJECT_M2` would send back
    at that range, if the sensor spread its pulses over the whole sphere. The neighbourhood is a slab of 3 x 3
    voxels of 1.5 cells (0.3 m at least), 0.75 voxels high, so that ground does not support an echo 0.15 m
    below it. Where fewer than `LEAST_SUPPORT` are expected, that many returns must be in a block 3.75 voxels
    high. A return that is isolated on its level and close below a surface of many returns is dropped. Very
    sparsely sampled ground is dropped too, and stays unknown. Where most returns are isolated, isolation is
    no criterion, and all are kept.

    Parameters
    ----------
    points_enu_m
        (n, 3) returns of one window, finite.
    sensor_enu_m
        (3,) position of the sensor; NaN where unknown.
    """
    if not len(points_enu_m):
        return np.ones(0, bool)
    points = np.ascontiguousarray(points_enu_m)
    keep = is_supported(points, sensor_enu_m, max(0.3, 1.5 * cell_m), LEAST_SUPPORT, OBJECT_M2)
    return keep if keep.mean() > 0.5 else np.ones(len(keep), bool)


class IsolatedReturns:
    """Memory of isolated returns: a thin object may send back one in every window.

    An isolated return counts when `OFTEN` of the last `RECENT` windows, the present one included, had one
    within `PLACE_M` of it; then the earlier ones count too. Dust is elsewhere in the next window. Near the
    sensor, where an object would send back several returns and dust is dense, none counts.
    """

    def __init__(self) -> None:
        self._windows: deque[cKDTree] = deque(maxlen=RECENT - 1)

    def recurring(
        self, lone_enu_m: NDArray[np.float64], sensor_enu_m: NDArray[np.float64], n_returns: int
    ) -> NDArray[np.float64]:
        """Add the isolated returns of a window of `n_returns`; return (m, 3) those that count now."""
        way = lone_enu_m - sensor_enu_m
        expected = OBJECT_M2 * n_returns / (4 * np.pi) / np.maximum(np.einsum("ij,ij->i", way, way), 1e-2)
        lone = lone_enu_m[expected <= LEAST_SUPPORT]
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
