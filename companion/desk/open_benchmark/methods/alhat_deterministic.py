"""Deterministic hazard detection of ALHAT: slope and roughness of a lander on three pads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from companion.desk.open_benchmark.landing_task import (
    SAFE,
    UNKNOWN,
    UNSAFE,
    FlownReturns,
    LandingTask,
    SafeMap,
)
from companion.desk.open_benchmark.methods.lander_pads import elevation_map, resting_planes, roughness


@dataclass(frozen=True, slots=True)
class AlhatDeterministic:
    """Worst slope and worst height above the plane of the pads, over all headings, against limits.

    Ivanov, Huertas and Lim, Probabilistic Hazard Detection for Autonomous Safe Landing, AIAA 2013-5019, the
    deterministic form to which it compares itself. What lies below the plane is no hazard but under a pad.
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


METHOD = AlhatDeterministic()
