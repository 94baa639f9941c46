"""Registration of a window to the map: removal of navigation errors in height and attitude.

A barometer drifts by decimetres in a minute and an attitude is off by tenths of a degree, so flat ground seen
twice would become a step. The correction is what most returns agree on: a shift in height and a tilt about
the sensor. Obstacles and moving objects do not affect it; plants are left out (`slz.points.solid_ground`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.kernels.points.robust_regression import robust_fit, subtract_plane
from slz.points.solid_ground import SolidGround

FEWEST_RETURNS = 300
LEAST_SHARE = 0.05  # of returns over known ground that are over solid ground; a road in a field has 0.1
FEWEST_SPREAD_M = 2.0  # standard deviation of the positions along an axis, below which it has no tilt
MOST_TILT_RAD = np.radians(4.0)  # two attitudes that are off by 1.3 degrees differ by 2.6 (PX4, accelerating)
ROUNDS = 6
UNSURE = 0.2  # of the depth of returns: a meadow seen from one height and way differs by 0.1 in the mean


@dataclass(frozen=True, slots=True)
class Offset:
    """Offset of a window over the map: at the sensor (m), and per metre to the east and to the north."""

    up_m: float = 0.0
    east: float = 0.0
    north: float = 0.0

    def removed_from(
        self, points_enu_m: NDArray[np.float64], sensor_enu_m: NDArray[np.float64], up_m: float
    ) -> NDArray[np.float64]:
        """Return points (n, 3) without the offset, lowered by `up_m`; the same array if both are zero."""
        up_m += self.up_m
        if up_m == self.east == self.north == 0:
            return points_enu_m
        return subtract_plane(points_enu_m, sensor_enu_m, up_m, self.east, self.north)


def offset(ground: SolidGround, sensor_enu_m: NDArray[np.float64], most_m: float) -> Offset:
    """Return the offset of a window over the map, by Tukey's robust regression.

    It is zero where too little solid ground is below: navigation alone is better than a registration to
    plants. A tilt is fitted along the principal axes of the ground that are long enough, so that a road
    through a field determines the tilt along it.

    Parameters
    ----------
    most_m
        Bound on the shift in height; beyond it the offset is zero.
    """
    found = ground.differences
    if len(found) < FEWEST_RETURNS or ground.share < LEAST_SHARE:
        return Offset()
    middle = found[:, :2].mean(axis=0)
    places = found[:, :2] - middle
    axes = wide_axes(places, FEWEST_SPREAD_M)
    (up, *slopes), share = robust_plane(places, found[:, 2], axes, ROUNDS)
    unsure_m = UNSURE * ground.depth_m
    up = _beyond(up, unsure_m)
    along = [_beyond(float(np.dot(slopes, axis)), unsure_m / float((places @ axis).std())) for axis in axes.T]
    east, north = axes @ np.array(along)
    up += float((sensor_enu_m[:2] - middle) @ (east, north))
    if share < 0.5 or abs(up) > most_m or np.hypot(east, north) > MOST_TILT_RAD:
        return Offset()
    return Offset(up, float(east), float(north))


def _beyond(value: float, least: float) -> float:
    """Return what a value exceeds a bound by, with its sign."""
    return math.copysign(max(0.0, abs(value) - least), value)


def wide_axes(places: NDArray[np.float64], least_m: float) -> NDArray[np.float64]:
    """Return (2, k) unit vectors of the principal axes along which places (n, 2) spread by `least_m`.

    The spread is a standard deviation. If both axes are wide enough, east and north are returned.
    """
    off = places - places.mean(axis=0)
    (east2, both), (_, north2) = (off.T @ off / len(off)).tolist()
    half, mean = math.hypot((east2 - north2) / 2, both), (east2 + north2) / 2
    if mean - half >= least_m**2:
        return np.eye(2)
    if not mean + half >= least_m**2:
        return np.empty((2, 0))
    bearing = math.atan2(2 * both, east2 - north2) / 2
    return np.array([[math.cos(bearing)], [math.sin(bearing)]])


def robust_plane(
    places: NDArray[np.float64], heights: NDArray[np.float64], axes: NDArray[np.float64], rounds: int
) -> tuple[tuple[float, float, float], float]:
    """Return height at the origin, slope east and north of a robust plane, and the share that agrees with it.

    Parameters
    ----------
    places, heights
        (n, 2) and (n,).
    axes
        (2, k) unit vectors along which a slope is fitted; none fits the height alone.
    rounds
        Of reweighting.
    """
    design = np.column_stack([np.ones(len(places)), places @ axes])
    fit, share = robust_fit(design, np.ascontiguousarray(heights), rounds)
    east, north = axes @ fit[1:]
    return (float(fit[0]), float(east), float(north)), share


def median(values: NDArray[np.float64]) -> float:
    """Return the upper median of values (n,), n > 0."""
    middle = len(values) // 2
    return float(np.partition(values, middle)[middle])
