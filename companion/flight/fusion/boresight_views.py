"""Least-squares estimate of a wrong boresight from views of the same ground under several headings.

A mount whose roll or pitch is wrong tilts all ground, about axes that turn with the vehicle: seen under
another heading, the same ground has another tilt. Each view has errors of its own, in height and in the
autopilot's attitude, with prior standard deviations; the height of each cell of ground is eliminated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CELL_M = 2.0  # side of a cell, whose mean heights are compared
FEWEST_RETURNS, MOST_SPREAD_M = 3, 0.3  # of a cell of ground in a view; walls and trees spread more
FEWEST_CELLS = 60  # seen in several views, of all views together
HEIGHT_M = 0.05  # standard deviation of a cell's mean height beside the noise of its returns
SHIFT_M, TILT_RAD = 5.0, math.radians(0.7)  # prior standard deviations of a view's height and attitude
PRIOR_RAD = math.radians(20.0)  # of the boresight
# Standard deviation of a tilt that turns with the vehicle and is none of the mount: an accelerometer's bias.
BIAS_DEG = 0.5
TUKEY = 4.685
ROUNDS = 4

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class View:
    """Cells of ground in a second's returns.

    keys: (n,) numbers of the cells. way_enu_m: (n, 2) from sensor to mean place. up_m, variance_m2: (n,) mean
    height and its variance. sensor_enu_m: (3,). axes: (2, 2) east and north of the body's forward and left.
    """

    keys: NDArray[np.int64]
    way_enu_m: Floats
    up_m: Floats
    variance_m2: Floats
    sensor_enu_m: Floats
    axes: Floats

    @property
    def heading_rad(self) -> float:
        """Direction of the body's forward axis from east, counter-clockwise."""
        return math.atan2(self.axes[0, 1], self.axes[0, 0])

    @classmethod
    def of(cls, points_enu_m: Floats, sensors_enu_m: Floats, rotation_enu_from_frd: Floats) -> View:
        """Return the view of returns (n, 3), with the sensor's place at each, and the body's rotation."""
        cells = np.floor(points_enu_m[:, :2] / CELL_M).astype(np.int64)
        keys, cell, count = np.unique(
            (cells[:, 0] << 32) + cells[:, 1], return_inverse=True, return_counts=True
        )
        columns = (*(points_enu_m - sensors_enu_m)[:, :2].T, points_enu_m[:, 2])
        east, north, up = (np.bincount(cell, column) / count for column in columns)
        spread = np.bincount(cell, (points_enu_m[:, 2] - up[cell]) ** 2) / count
        good = (count >= FEWEST_RETURNS) & (spread < MOST_SPREAD_M**2)
        forward_left = (rotation_enu_from_frd[:2, :2] * (1.0, -1.0)).T
        return cls(
            keys[good],
            np.column_stack([east, north])[good],
            up[good],
            (spread / count)[good] + HEIGHT_M**2,
            sensors_enu_m.mean(axis=0),
            forward_left,
        )


@dataclass(frozen=True, slots=True)
class Boresight:
    """Error of the stated mount.

    error_deg: (2,) rotation about the body's forward and left axes, roll and pitch. covariance_deg2: (2, 2).
    """

    error_deg: Floats
    covariance_deg2: Floats

    @property
    def sigmas(self) -> float:
        """Significance of the error, in standard deviations of it and of what is none of the mount."""
        spread = self.covariance_deg2 + BIAS_DEG**2 * np.eye(2)
        return math.sqrt(float(self.error_deg @ np.linalg.solve(spread, self.error_deg)))


def estimate(views: list[View]) -> Boresight | None:
    """Return the boresight's error by Tukey's robust regression; None where too little is seen twice."""
    _, cell, seen = np.unique(
        np.concatenate([view.keys for view in views]), return_inverse=True, return_counts=True
    )
    twice = seen[cell] > 1
    if np.count_nonzero(seen > 1) < FEWEST_CELLS:
        return None
    view = np.repeat(np.arange(len(views)), [len(one.keys) for one in views])[twice]
    way = np.concatenate([one.way_enu_m for one in views])[twice]
    up = np.concatenate([one.up_m for one in views])[twice]
    weight = 1 / np.concatenate([one.variance_m2 for one in views])[twice]
    axes = np.array([one.axes for one in views])[view]
    row = np.arange(len(up))
    design = np.zeros((len(up), 2 + 3 * len(views)))
    design[:, :2] = axes[:, :, 0] * way[:, 1, None] - axes[:, :, 1] * way[:, 0, None]
    for column, values in enumerate((np.ones(len(up)), way[:, 1], -way[:, 0])):
        design[row, 2 + 3 * view + column] = values
    _, cell = np.unique(cell[twice], return_inverse=True)
    prior = np.array([PRIOR_RAD] * 2 + [SHIFT_M, TILT_RAD, TILT_RAD] * len(views))
    found, covariance = _robust(design, up - up.mean(), weight, cell, prior)
    return Boresight(np.degrees(found[:2]), np.degrees(np.degrees(covariance[:2, :2])))


def _robust(
    design: Floats, values: Floats, weight: Floats, cell: NDArray[np.intp], prior: Floats
) -> tuple[Floats, Floats]:
    """Return coefficients and covariance of a regression in which each cell has a constant of its own."""
    n_cells = int(cell.max()) + 1
    where = (cell[:, None] * design.shape[1] + np.arange(design.shape[1])).ravel()
    share, scale = np.ones(len(values)), 1.0
    for _ in range(ROUNDS):
        own = weight * share / scale**2
        total = np.maximum(np.bincount(cell, own, n_cells), 1e-12)
        weighted = design * own[:, None]
        sums = np.bincount(where, weighted.ravel(), n_cells * design.shape[1]).reshape(n_cells, -1)
        mean = np.bincount(cell, own * values, n_cells) / total
        normal = weighted.T @ design - (sums / total[:, None]).T @ sums + np.diag(prior**-2.0)
        covariance = np.asarray(np.linalg.inv(normal), np.float64)
        found = covariance @ (weighted.T @ values - sums.T @ mean)
        error = values - mean[cell] - design @ found + ((sums / total[:, None]) @ found)[cell]
        scaled = np.sqrt(weight) * np.abs(error)
        scale = max(1.0, 1.4826 * float(np.median(scaled)))
        share = np.clip(1 - (scaled / (TUKEY * scale)) ** 2, 0, None) ** 2
    return found, covariance
