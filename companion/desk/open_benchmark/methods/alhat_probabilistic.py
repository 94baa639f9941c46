"""Probabilistic hazard detection of ALHAT: the probability that slope and roughness are safe."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, ndtr

from companion.desk.open_benchmark.landing_task import (
    SAFE,
    UNKNOWN,
    UNSAFE,
    FlownReturns,
    LandingTask,
    SafeMap,
)
from companion.desk.open_benchmark.methods.lander_pads import elevation_map, resting_planes, roughness

LEAST_SIGMA_M = 1e-3


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


METHOD = AlhatProbabilistic()
