"""Least-squares plane of all returns in the footprint, and thresholds of slope and residual."""

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
from companion.desk.open_benchmark.methods.elevation_grid import (
    footprint_planes,
    footprint_reach,
    footprint_relief,
)
from companion.desk.open_benchmark.methods.outlier_removal import without_outliers


@dataclass(frozen=True, slots=True)
class PlaneThreshold:
    """Plane fit per footprint, as the coarse evaluation of Scherer, Chamberlain and Singh.

    Autonomous landing at unprepared sites by a full-scale helicopter, Robotics and Autonomous Systems 60(12),
    2012: slope and residual of the plane of a patch against limits, and enough returns in it. The residual
    here is peak to peak, from the lowest and highest return of each cell, as the task's limit of relief is.
    """

    name: str = "plane fit + threshold"
    source: str = (
        "Scherer, Chamberlain, Singh 2012 (RAS 60(12)), coarse evaluation; chosen: outlier removal of"
        " Rusu 2008, residual peak to peak, 12 returns at least"
    )
    least: int = 12

    def judge(self, returns: FlownReturns, task: LandingTask) -> SafeMap:
        returns = without_outliers(returns)
        grid = task.grid
        reach = footprint_reach(task, grid.cell_m)
        count, level, gx, gy = footprint_planes(returns, grid, reach)
        relief = footprint_relief(returns, grid, reach, level, gx, gy)
        slope = np.degrees(np.arctan(np.hypot(gx, gy)))
        safe = (slope <= task.slope_limit_deg) & (relief <= task.relief_limit_m)
        known = (count >= self.least) & np.isfinite(slope)
        share = np.maximum(slope / task.slope_limit_deg, relief / task.relief_limit_m)
        return SafeMap(
            np.where(known, np.where(safe, SAFE, UNSAFE), UNKNOWN).astype(np.uint8),
            limit_share=np.where(known, share, np.nan).astype(np.float32),
        )


METHOD = PlaneThreshold()
