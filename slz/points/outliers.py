"""Outlier removal in default mode: heights beyond an empty gap, and isolated returns.

These rules are safer than the sources' histogram rule, which trims sparse end bins (SLZ paper, section 3.2.1;
SLZ thesis, section 3.3.1.1): see `slz.kernels.paper.height_gate`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from params import Parameters
from slz.frame import is_known
from slz.kernels.points.histogram import gaps_of
from slz.kernels.points.range_gate import within_reach
from slz.kernels.points.voxel_density_filter import is_supported

Points = NDArray[np.float64]
LEAST_SUPPORT = 2
OBJECT_M2 = 0.005  # 5 x 10 cm: the smallest object that must not be removed as dust
CLOUD_GROUP = (1.5, 3)  # metres, returns: a wire, a mast's top, a shaft's bottom
FLIGHT_GROUP = (0.6, 5)  # the smallest object to detect, 0.5 x 0.3 m with 5 pulses; echoes are farther apart


def reach_m(parameters: Parameters) -> float:
    """Return the horizontal distance from the sensor up to which returns are mapped (m).

    An error of a ray's direction moves its return up or down by that angle times the horizontal distance.
    Beyond the distance where this exceeds `height_noise_m`, noise alone would use up the relief limit; such
    ground stays unknown until the vehicle is nearer. The sources have no such rule.
    """
    p = parameters
    if p.mode == "source" or p.angle_noise_deg == 0:
        return p.max_range_m
    allowed = max(0.0, p.height_noise_m**2 - p.range_noise_m**2) ** 0.5
    return float(min(p.max_range_m, allowed / math.radians(p.angle_noise_deg)))


def within(points_enu_m: Points, sensor_enu_m: Points, reach_m: float) -> NDArray[np.bool_]:
    """Return the mask of the points within a horizontal range; all where the sensor's place is unknown."""
    if not is_known(sensor_enu_m[:2]):
        return np.ones(len(points_enu_m), bool)
    return within_reach(points_enu_m, sensor_enu_m, reach_m**2)


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
    points_enu_m: NDArray[np.float64], sensor_enu_m: NDArray[np.float64], cell_m: float, looks: int = 1
) -> NDArray[np.bool_]:
    """Return which returns of a window are not isolated.

    Rain, dust and multipath returns are isolated; ground and objects are hit repeatedly, more often at short
    range. A return is isolated when fewer others are around it than an object of `OBJECT_M2` would send back
    at that range, if the sensor spread its pulses over the whole sphere; `LEAST_SUPPORT` at the least, itself
    included, and one in ten of the returns within 1.5 voxels and 5 voxels of height, up to five. The
    neighbourhood is a slab of 3 x 3 voxels of 1.5 cells (0.3 m at least), 0.75 voxels high, so that ground
    does not support an echo 0.15 m from it. Sparsely sampled ground and thin objects are isolated too; the
    near map judges them by all windows, see `slz.terrain.thin_objects`.

    Parameters
    ----------
    points_enu_m
        (n, 3) returns of one window, finite.
    sensor_enu_m
        (3,) position of the sensor; NaN where unknown.
    looks
        How many such windows last as long as `window_s`. An object must send back as many returns in this
        one as it would in all of them, so that two pulses on a speck of dust at the sensor are isolated.
    """
    if not len(points_enu_m):
        return np.ones(0, bool)
    points = np.ascontiguousarray(points_enu_m)
    return is_supported(points, sensor_enu_m, max(0.3, 1.5 * cell_m), LEAST_SUPPORT, OBJECT_M2 * looks)


def is_dense_at(
    points_enu_m: NDArray[np.float64], sensor_enu_m: NDArray[np.float64], n_returns: int
) -> NDArray[np.bool_]:
    """Return which points are so near to the sensor that an object there would not be isolated.

    A window of `n_returns` would hold more than `LEAST_SUPPORT` returns of an object of `OBJECT_M2`; what is
    isolated so near is dust, which is dense around the rotors.
    """
    way = points_enu_m - sensor_enu_m
    distance2 = np.maximum(np.einsum("ij,ij->i", way, way), 1e-2)
    return np.asarray(OBJECT_M2 * n_returns / (4 * np.pi) / distance2 > LEAST_SUPPORT)
