"""Boresight and time-offset estimation from the agreement of overlapping passes.

A wrong boresight or time offset places the same ground at other heights from another side, another height
or another speed. Returns are grouped in cubes; where they form a plane, their distances from it should be
the sensor's noise. Gauss-Newton minimises these distances. Each cube's plane is projected out of the
distances and of their derivatives, since it moves with the unknowns.

The navigation drifts. Its error is modelled as constant over some seconds, and estimated, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
NAMES = ("roll_deg", "pitch_deg", "yaw_deg", "delay_ms")
STEPS = np.array([0.02, 0.02, 0.02, 0.5])  # of the numerical derivatives
CUBES_M = (4.0, 2.0, 1.0)
ROUNDS = 12
FEWEST = 24  # returns in a cube
PASS_S = 3.0  # two observations of a cube are two passes if they are further apart in time
FLAT = 0.15  # largest ratio of a plane's smallest extent to its middle one
MOST_M = 0.3  # larger distances are no noise
TUKEY = 4.685
BLOCK_S = 4.0  # over which the navigation error is modelled as constant
MOST_BLOCKS = 60
DRIFT_M = 0.3  # prior standard deviation of the navigation error
MOST_RETURNS = 60_000
EXPECTED = np.array([3.0, 3.0, 3.0, 50.0])  # prior standard deviations
SMALLEST_SHARE = 0.1  # of a cube's returns that must be of its smaller pass

Place = Callable[[Floats], Floats]


@dataclass(frozen=True, slots=True)
class Fit:
    """Result: correction (4,) in the units of `NAMES`, its standard errors, and the agreement of the returns.

    before_m, after_m: robust standard deviation of the distances from the planes of the cubes of 1 m,
    without and with the correction. cubes, returns: numbers used.
    """

    correction: Floats
    sigma: Floats
    before_m: float
    after_m: float
    cubes: int
    returns: int


class TooLittleError(ValueError):
    """The flight does not show enough ground twice."""


@dataclass(frozen=True, slots=True)
class _Cubes:
    """Returns in cubes with a plane that two passes observed.

    index: numbers of the returns (m,). cube: the cube of each. count: of cubes. normal: of each return's
    plane (m, 3). basis: (m, 3) 1 and the coordinates within the plane, orthonormal within each cube.
    """

    index: NDArray[np.intp]
    cube: NDArray[np.intp]
    count: int
    normal: Floats
    basis: Floats


def solve(place: Place, stamp_s: Floats, fixed: NDArray[np.bool_]) -> Fit:
    """Return the correction with the best agreement of the returns.

    Parameters
    ----------
    place
        Function from a correction (4,) to the georeferenced returns (n, 3).
    stamp_s
        Of the returns (n,).
    fixed
        (4,), mask of the `NAMES` that are not estimated.

    Raises
    ------
    TooLittleError
        No plane is seen twice.
    """
    correction = np.zeros(4)
    covariance = np.full((4, 4), np.inf)
    for side_m in CUBES_M:
        for _ in range(ROUNDS):
            step, covariance = _step(place, stamp_s, correction, side_m, ~fixed)
            correction = correction + step
            if (np.abs(step) < 0.05 * STEPS).all():
                break
    cubes = _gather(place(correction), stamp_s, CUBES_M[-1])
    return Fit(
        correction,
        np.sqrt(np.diag(covariance)),
        _spread(place(np.zeros(4)), cubes),
        _spread(place(correction), cubes),
        cubes.count,
        len(cubes.index),
    )


def _step(
    place: Place, stamp_s: Floats, at: Floats, side_m: float, free: NDArray[np.bool_]
) -> tuple[Floats, Floats]:
    """Return the Gauss-Newton step and the covariance of the estimated corrections.

    Errors are assumed independent between blocks of seconds, not within one; corrections that the flight
    does not determine keep their prior uncertainty.
    """
    points = place(at)
    cubes = _gather(points, stamp_s, side_m)
    residual = _distances(points, cubes)
    columns = []
    for k in np.flatnonzero(free):
        ahead, behind = at.copy(), at.copy()
        ahead[k] += STEPS[k]
        behind[k] -= STEPS[k]
        moved = (place(ahead) - place(behind))[cubes.index] / (2 * STEPS[k])
        columns.append(_without_plane(np.einsum("ij,ij->i", moved, cubes.normal), cubes))
    sought = len(columns)
    length_s = max(BLOCK_S, (float(stamp_s.max()) + 1e-3) / MOST_BLOCKS)
    block = (stamp_s[cubes.index] // length_s).astype(np.intp)
    blocks = int(block.max()) + 1
    for b in range(blocks):
        here = block == b
        columns += [_without_plane(np.where(here, axis, 0.0), cubes) for axis in cubes.normal.T]
    design = np.column_stack(columns)
    scale = max(0.005, 1.4826 * float(np.median(np.abs(residual))))
    weight = np.clip(1 - (residual / (TUKEY * scale)) ** 2, 0, None) ** 2
    before = np.concatenate([EXPECTED[free], np.full(3 * blocks, DRIFT_M)])
    normal = design.T @ (design * weight[:, None]) + np.diag((scale / before) ** 2)
    inverse = np.linalg.inv(normal)[:sought]
    score = design.T @ (weight * residual)
    score[:sought] += (scale / EXPECTED[free]) ** 2 * at[free]
    step, covariance = np.zeros(4), np.zeros((4, 4))
    step[free] = -inverse @ score
    left = residual - design @ (np.linalg.inv(normal) @ score)
    parts = np.column_stack([np.bincount(block, weight * left * column, blocks) for column in design.T])
    spread = inverse @ parts.T
    covariance[np.ix_(free, free)] = spread @ spread.T + scale**2 * inverse[:, :sought]
    most = np.array([1.0, 1.0, 1.0, 20.0])
    return np.clip(step, -most, most), covariance


def _gather(points: Floats, stamp_s: Floats, side_m: float) -> _Cubes:
    """Return the cubes with a plane that two passes observed."""
    index = np.arange(len(points))
    key = np.floor(points / side_m).astype(np.int64)
    key -= key.min(axis=0)
    flat = (key[:, 0] << 42) | (key[:, 1] << 21) | key[:, 2]
    _, cube, count = np.unique(flat, return_inverse=True, return_counts=True)
    first = np.full(len(count), np.inf)
    np.minimum.at(first, cube, stamp_s)
    later = np.bincount(cube, stamp_s - first[cube] > PASS_S, len(count)) / np.maximum(count, 1)
    good = (count >= FEWEST) & (later > SMALLEST_SHARE) & (later < 1 - SMALLEST_SHARE)
    index, cube = index[good[cube]], (np.cumsum(good) - 1)[cube[good[cube]]]
    if not good.any():
        raise TooLittleError("no ground is seen in two passes that overlap")
    values, vectors, off = _axes(points[index], cube, int(good.sum()))
    flat_ones = (values[:, 0] < FLAT**2 * values[:, 1]) & (values[:, 0] < MOST_M**2)
    if not flat_ones.any():
        raise TooLittleError("no ground that is seen twice is flat")
    kept = flat_ones[cube]
    kept &= (np.cumsum(kept) % max(1, int(kept.sum()) // MOST_RETURNS)) == 0
    turn, extent = vectors[cube[kept]], np.sqrt(values[cube[kept]])
    basis = np.column_stack(
        [np.ones(len(turn)), np.einsum("ij,ijk->ik", off[kept], turn)[:, 1:] / extent[:, 1:]]
    )
    return _Cubes(
        index[kept], (np.cumsum(flat_ones) - 1)[cube[kept]], int(flat_ones.sum()), turn[:, :, 0], basis
    )


def _axes(points: Floats, cube: NDArray[np.intp], count: int) -> tuple[Floats, Floats, Floats]:
    """Return each cube's variances along its principal axes, smallest first, the axes, and centred points."""
    n = np.bincount(cube, minlength=count)
    middle = np.column_stack([np.bincount(cube, axis, count) for axis in points.T]) / n[:, None]
    off = points - middle[cube]
    spread = np.empty((count, 3, 3))
    for i in range(3):
        for j in range(3):
            spread[:, i, j] = np.bincount(cube, off[:, i] * off[:, j], count) / n
    values, vectors = np.linalg.eigh(spread)
    return np.maximum(values, 1e-12), vectors, off


def _distances(points: Floats, cubes: _Cubes) -> Floats:
    """Return each return's distance from its cube's plane."""
    return _without_plane(np.einsum("ij,ij->i", points[cubes.index], cubes.normal), cubes)


def _without_plane(values: Floats, cubes: _Cubes) -> Floats:
    """Return values less their least-squares linear function of position within each cube."""
    n = np.maximum(np.bincount(cubes.cube, minlength=cubes.count), 1)
    left = values - (np.bincount(cubes.cube, values, cubes.count) / n)[cubes.cube]
    for axis in (1, 2):
        share = np.bincount(cubes.cube, left * cubes.basis[:, axis], cubes.count) / n
        left = left - share[cubes.cube] * cubes.basis[:, axis]
    return left


def _spread(points: Floats, cubes: _Cubes) -> float:
    return 1.4826 * float(np.median(np.abs(_distances(points, cubes))))
