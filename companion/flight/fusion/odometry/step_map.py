"""Step map: heights of cells, whose steps (roofs, parapets, kerbs, stands) give the place from above.

From 20 m a LiDAR that looks down sees a hundredth of its returns on walls, but many more near an edge: those
that a false place would put on the other level. As with the height maps of Olson (2009,
doi:10.1109/ROBOT.2009.5152375) every shift within reach is tried, so that no step is too high.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.flight.fusion.odometry.step_kernels import (
    CELL_M,
    COARSE_SIDE,
    EMPTY,
    SHIFTS,
    SIDE,
    STRIDES,
    insert,
    misfits,
)
from companion.flight.fusion.odometry.surfel_map import HOLD_NS

Floats = NDArray[np.float64]
FEWEST = 30  # returns near steps
# Share of the returns that fit no cell even where most do: things that moved, leaves, mixed returns. Where it
# is greater, scan and map are of different places.
LEAST_SHARE, MOST_SHARE = 0.03, 0.12
SHARED = 5.0  # returns that count as an independent one
PRIOR_M = 0.5  # standard deviation of the shift, without returns
YAW_RAD = np.radians(0.5)  # heading that scan and map may differ by


class StepMap:
    """Lowest and highest return of each cell, within five seconds of its first."""

    def __init__(self) -> None:
        self._keys = np.full((SIDE, SIDE), EMPTY)
        self._coarse_keys = np.full((COARSE_SIDE, COARSE_SIDE), EMPTY)
        self._tables = (
            self._keys,
            np.zeros((SIDE, SIDE), np.int64),
            np.zeros((SIDE, SIDE), np.int32),
            np.zeros((SIDE, SIDE), np.float32),
            np.zeros((SIDE, SIDE), np.float32),
            self._coarse_keys,
            np.zeros((COARSE_SIDE, COARSE_SIDE), np.float32),
        )
        self._misfit = np.zeros((SHIFTS, SHIFTS))
        stride_m = CELL_M / 2
        axis = stride_m * np.arange(-STRIDES, STRIDES + 1)
        self._shifts_m = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
        self._prior = -(self._shifts_m**2).sum(axis=1) / (2 * PRIOR_M**2)
        self._between = np.eye(2) * stride_m**2 / 12  # variance of a shift between two that are tried
        self._least = np.linalg.inv(self._moments(self._prior)[1])

    def clear(self) -> None:
        """Forget everything."""
        self._keys[:] = EMPTY
        self._coarse_keys[:] = EMPTY

    def add(self, points_enu_m: Floats, stamp_ns: int) -> None:
        """Add the points (n, 3) of a scan."""
        insert(points_enu_m, stamp_ns, HOLD_NS, *self._tables)

    def shift(self, points_enu_m: Floats, pivot_enu_m: Floats, stamp_ns: int) -> tuple[Floats, Floats, int]:
        """Return by how much points must be shifted to fit the cells that were seen five seconds ago.

        Parameters
        ----------
        points_enu_m
            Points (n, 3), at most half a metre beside their place.
        pivot_enu_m
            The sensor (3,) as the points are placed, about which the heading may be wrong.
        stamp_ns
            Time of the points.

        Returns
        -------
        tuple
            Shift east and north (2,) in metres, its information (2, 2) in 1/m2, and the number of points near
            steps; all 0 if these are few or do not fit.
        """
        used, east_m, north_m = misfits(
            points_enu_m, pivot_enu_m, stamp_ns, HOLD_NS, *self._tables, self._misfit
        )
        share = max(float(self._misfit.min()) / max(used, 1), LEAST_SHARE)
        if used < FEWEST or share > MOST_SHARE:
            return np.zeros(2), np.zeros((2, 2)), 0
        log_odds = np.log(1 / share - 1) / SHARED
        mean, covariance = self._moments(self._prior - log_odds * self._misfit.ravel())
        across = YAW_RAD * np.array([pivot_enu_m[1] - north_m, east_m - pivot_enu_m[0]])
        told = np.linalg.inv(covariance + np.outer(across, across)) - self._least
        values, axes = np.linalg.eigh(told)
        return mean, axes @ np.diag(np.maximum(values, 0.0)) @ axes.T, used

    def _moments(self, log_likelihood: Floats) -> tuple[Floats, Floats]:
        """Return mean (2,) and covariance (2, 2) of the shift."""
        weight = np.exp(log_likelihood - log_likelihood.max())
        weight /= weight.sum()
        mean = weight @ self._shifts_m
        away = self._shifts_m - mean
        return mean, (away * weight[:, None]).T @ away + self._between
