"""Registration of a window to the map: removal of navigation errors in height and attitude.

A barometer drifts by decimetres in a minute and an attitude is off by tenths of a degree, so flat ground seen
twice would become a step. The correction is what most returns agree on: a shift in height and a tilt about
the sensor. Obstacles and moving objects do not affect it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.kernels.points.robust_regression import subtract_plane, weighted_normal_equations
from slz.terrain.tiles import Tiles

MOST_RETURNS, PARTS = 20_000, 4  # returns compared with the map, and parts they are compared in
ENOUGH_RETURNS = 4_000  # returns over known ground: their mean is better than a millimetre
FEWEST_RETURNS = 300
FEWEST_SPREAD_M = 2.0  # standard deviation of the positions, below which no tilt is fitted
MOST_TILT_RAD = np.radians(4.0)  # two attitudes that are off by 1.3 degrees differ by 2.6 (PX4, accelerating)
ROUNDS = 6


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


def offset(
    points_enu_m: NDArray[np.float64],
    used: NDArray[np.intp],
    sensor_enu_m: NDArray[np.float64],
    tiles: Tiles,
    most_m: float,
) -> Offset:
    """Return the offset of a window over the map, by Tukey's robust regression; zero for too little overlap.

    Parameters
    ----------
    points_enu_m
        (n, 3) returns, in heights that include the map's datum.
    used
        (m,) indices of the returns to use.
    most_m
        Bound on the shift in height; beyond it the offset is zero.
    """
    found = _compared(points_enu_m, used, tiles)
    if len(found) < FEWEST_RETURNS:
        return Offset()
    places = found[:, :2] - sensor_enu_m[:2]
    level = bool((places.std(axis=0) < FEWEST_SPREAD_M).any())
    (up, east, north), share = robust_plane(places, found[:, 2], level, ROUNDS)
    if share < 0.5 or abs(up) > most_m or np.hypot(east, north) > MOST_TILT_RAD:
        return Offset()
    return Offset(up, east, north)


def robust_plane(
    places: NDArray[np.float64], heights: NDArray[np.float64], level: bool, rounds: int
) -> tuple[tuple[float, float, float], float]:
    """Return height at the origin, slope east and north of a robust plane, and the share that agrees with it.

    Parameters
    ----------
    places, heights
        (n, 2) and (n,).
    level
        Fit the height alone.
    rounds
        Of reweighting.
    """
    design = np.column_stack([np.ones(len(places)), *(() if level else places.T)])
    fit, share = _robust(design, np.ascontiguousarray(heights), rounds)
    up, east, north = (float(v) for v in (*fit, 0.0, 0.0)[:3])
    return (up, east, north), share


def _compared(points_enu_m: NDArray[np.float64], used: NDArray[np.intp], tiles: Tiles) -> NDArray[np.float64]:
    """Return (m, 4) of `Tiles.differences`, of returns spread over the window."""
    step = PARTS * max(1, len(used) // MOST_RETURNS)
    parts: list[NDArray[np.float64]] = []
    for first in range(0, step, step // PARTS):
        some = points_enu_m[used[first::step]] - np.array([0.0, 0.0, tiles.datum_m])
        parts.append(tiles.differences(some))
        if sum(map(len, parts)) >= ENOUGH_RETURNS:
            break
    return np.concatenate(parts)


def _robust(
    design: NDArray[np.float64], values: NDArray[np.float64], rounds: int
) -> tuple[NDArray[np.float64], float]:
    """Return the coefficients of a robust fit, and the share of values that agree with them."""
    fit: NDArray[np.float64] = np.zeros(design.shape[1])
    fit[0] = median(values)
    share = 0.0
    for _ in range(rounds):
        error = values - design @ fit
        scale = max(0.02, 1.4826 * median(np.abs(error)))
        left, right, share = weighted_normal_equations(design, values, error, 4.7 * scale)
        fit = np.asarray(np.linalg.solve(left + 1e-9 * np.eye(len(fit)), right))
    return fit, share


def median(values: NDArray[np.float64]) -> float:
    """Return the upper median of values (n,), n > 0."""
    middle = len(values) // 2
    return float(np.partition(values, middle)[middle])
