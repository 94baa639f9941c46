"""ALHAT: hazard detection by slope and roughness of a lander on pads, deterministic and probabilistic."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, ndtr

from companion.desk.open_benchmark.landing_task import (
    F64,
    SAFE,
    UNKNOWN,
    UNSAFE,
    FlownReturns,
    LandingTask,
    SafeMap,
)
from companion.desk.open_benchmark.methods.elevation_grid import (
    around,
    cell_statistics,
    fill_gaps,
    footprint_reach,
    median_of_nine,
)

HEADINGS_DEG = tuple(range(0, 90, 15))  # four pads look the same after 90 degrees
GAP_M = 0.5

LEAST_SIGMA_M = 1e-3


@dataclass(frozen=True, slots=True)
class RestingPlanes:
    """Plane through three pads, for every cell at one heading.

    level_m, gx, gy: (rows, cols) height at the centre and gradients; NaN where a pad is on unknown ground.
    spread: (2, 2) covariance of the gradient for heights of variance 1.
    """

    level_m: F64
    gx: F64
    gy: F64
    spread: F64

    @property
    def slope_deg(self) -> F64:
        return np.degrees(np.arctan(np.hypot(self.gx, self.gy)))


@dataclass(frozen=True, slots=True)
class AlhatDeterministic:
    """Worst slope and worst height above the plane of the pads, over all headings, against limits.

    Ivanov, Huertas and Lim, Probabilistic Hazard Detection for Autonomous Safe Landing, AIAA 2013-5019, the
    deterministic form to which it compares itself. Ground below the plane is a hazard only under a pad.
    """

    name: str = "ALHAT, deterministic"
    source: str = (
        "Ivanov, Huertas, Lim 2013 (AIAA 2013-5019); chosen: pads on a circle of the footprint's side, six"
        " headings, nine-point median"
    )

    def judge(self, returns: FlownReturns, task: LandingTask) -> SafeMap:
        heights = elevation_map(returns, task)
        steepest, highest = np.zeros((2, *task.grid.shape))
        for plane in resting_planes(heights, task):
            steepest = np.maximum(steepest, plane.slope_deg)
            for row, above in roughness(heights, plane, task):
                highest[row] = np.maximum(highest[row], above.max(axis=(1, 2)))
        safe = (steepest <= task.slope_limit_deg) & (highest <= task.relief_limit_m)
        known = np.isfinite(steepest) & np.isfinite(highest)
        return SafeMap(np.where(known, np.where(safe, SAFE, UNSAFE), UNKNOWN).astype(np.uint8))


@dataclass(frozen=True, slots=True)
class AlhatProbabilistic:
    """Probability of safe slope times that of safe roughness, at the worst heading.

    Ivanov, Huertas and Lim, Probabilistic Hazard Detection for Autonomous Safe Landing, AIAA 2013-5019: the
    heights of the elevation map have independent normal errors. Roughness is safe with the product over the
    cells of the footprint of the probability that each is below the limit above the plane of the pads; slope
    with the probability that the gradient, by the errors of the three pads, is below its limit.
    """

    name: str = "ALHAT, probabilistic"
    source: str = (
        "Ivanov, Huertas, Lim 2013 (AIAA 2013-5019); chosen: safe from 0.9 on, error of heights = noise of"
        " ranges"
    )
    safe_from: float = 0.9

    def judge(self, returns: FlownReturns, task: LandingTask) -> SafeMap:
        heights = elevation_map(returns, task)
        sigma = max(task.range_noise_m, LEAST_SIGMA_M)
        limit = np.tan(np.radians(task.slope_limit_deg))
        probability = np.ones(task.grid.shape)
        for plane in resting_planes(heights, task):
            size = np.hypot(plane.gx, plane.gy)
            east, north = plane.gx / np.maximum(size, 1e-12), plane.gy / np.maximum(size, 1e-12)
            s = plane.spread
            error = sigma * np.sqrt(s[0, 0] * east**2 + 2 * s[0, 1] * east * north + s[1, 1] * north**2)
            slope_safe = ndtr((limit - size) / np.maximum(error, 1e-9))
            for row, above in roughness(heights, plane, task):
                rough_safe = np.exp(log_ndtr((task.relief_limit_m - above) / sigma).sum(axis=(1, 2)))
                probability[row] = np.minimum(probability[row], slope_safe[row] * rough_safe)
        known = np.isfinite(probability)
        state = np.where(probability >= self.safe_from, SAFE, UNSAFE)
        return SafeMap(np.where(known, state, UNKNOWN).astype(np.uint8), probability.astype(np.float32))


def elevation_map(returns: FlownReturns, task: LandingTask) -> F64:
    """Return the elevation map: means of cells, median of nine (Flash §2.4), gaps of 0.5 m filled."""
    heights = median_of_nine(cell_statistics(returns, task.grid).mean_m)
    return fill_gaps(heights, GAP_M / task.grid.cell_m)


def resting_planes(height_m: F64, task: LandingTask) -> Iterator[RestingPlanes]:
    """Yield the planes on which the lander may rest: two for each heading.

    Four pads are on a circle whose diameter is the footprint. The lander rests on three of them, on the
    diagonal whose heights add up to more and on either pad of the other; the fourth hangs in the air.
    """
    cell = task.grid.cell_m
    for heading in HEADINGS_DEG:
        angle = np.radians(heading + 90.0 * np.arange(4))
        offset = np.rint(np.stack([np.sin(angle), np.cos(angle)]) * task.footprint_m / 2 / cell).astype(int)
        reach = int(np.abs(offset).max())
        near = around(height_m, reach)
        pads = np.stack([near[..., reach + dr, reach + dc] for dr, dc in offset.T])
        first = pads[0] + pads[2] >= pads[1] + pads[3]  # the diagonal of pads 0 and 2 carries
        north, east = offset * cell
        for either in (1, 3):
            own, other = (0, 2, either), (1, 3, either - 1)
            yield _joined(first, _through(pads, east, north, own), _through(pads, east, north, other))


def roughness(
    height_m: F64, plane: RestingPlanes, task: LandingTask
) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Yield row by row the heights (cols, m, m) of the footprint's ground above a plane; NaN unknown."""
    reach = footprint_reach(task, task.grid.cell_m)
    near = around(height_m, reach)
    offset = np.arange(-reach, reach + 1) * task.grid.cell_m
    for row in range(task.grid.rows):
        gx, gy = plane.gx[row, :, None, None], plane.gy[row, :, None, None]
        ground = plane.level_m[row, :, None, None] + gy * offset[None, :, None] + gx * offset[None, None, :]
        yield row, near[row] - ground


def _through(pads: F64, east: F64, north: F64, which: tuple[int, ...]) -> RestingPlanes:
    three = list(which)
    solve = np.linalg.inv(np.column_stack([np.ones(3), east[three], north[three]]))
    level, gx, gy = np.tensordot(solve, pads[three], axes=1)
    return RestingPlanes(level, gx, gy, solve[1:] @ solve[1:].T)


def _joined(first: NDArray[np.bool_], one: RestingPlanes, two: RestingPlanes) -> RestingPlanes:
    level, gx, gy = (
        np.where(first, a, b) for a, b in ((one.level_m, two.level_m), (one.gx, two.gx), (one.gy, two.gy))
    )
    return RestingPlanes(level, gx, gy, (one.spread + two.spread) / 2)
