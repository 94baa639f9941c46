"""Thresholds of slope: Horn's gradient, a least-squares plane; and the reference that has none."""

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
    around,
    cell_statistics,
    fill_gaps,
    footprint_most,
    footprint_planes,
    footprint_reach,
    footprint_relief,
    footprint_state,
    on_task_grid,
    values_on_task_grid,
    without_outliers,
)

STEPS_M = (0.2, 0.25, 0.5, 1.0, 2.0)


@dataclass(frozen=True, slots=True)
class GradientThreshold:
    """Mean heights of cells that hold 4 returns on average, Horn's slope, and the task's limit of slope.

    Horn, Hill shading and the reflectance map, Proc. IEEE 69(1), 1981: differences over eight neighbours,
    weights 1, 2, 1; the slope of GIS programs. Single empty cells take their nearest neighbour. A footprint
    is safe if all of its cells are. It has no limit of relief.
    """

    name: str = "gradient + threshold"
    source: str = (
        "Horn 1981 (Proc. IEEE 69(1)), as in GIS programs; chosen: outlier removal of Rusu 2008, cells of"
        " 4 returns on average, whole footprint below the limit"
    )
    returns_per_cell: float = 4.0

    def judge(self, returns: FlownReturns, task: LandingTask) -> SafeMap:
        returns = without_outliers(returns)
        area = task.grid.rows * task.grid.cols * task.grid.cell_m**2
        wanted = float(np.sqrt(self.returns_per_cell * area / max(1, len(returns))))
        cell = next((step for step in STEPS_M if step >= max(0.95 * wanted, task.grid.cell_m)), STEPS_M[-1])
        grid = task.grid.with_cells(max(cell, task.grid.cell_m))
        z = around(fill_gaps(cell_statistics(returns, grid).mean_m, 1.0), 1)
        weights = np.array([1.0, 2.0, 1.0])
        east = (z[..., 2] - z[..., 0]) @ weights / (8 * grid.cell_m)
        north = (z[..., 2, :] - z[..., 0, :]) @ weights / (8 * grid.cell_m)
        slope = np.degrees(np.arctan(np.hypot(east, north)))
        reach = footprint_reach(task, grid.cell_m)
        safe = footprint_state(slope <= task.slope_limit_deg, slope > task.slope_limit_deg, reach)
        most = footprint_most(slope / task.slope_limit_deg, reach)
        return SafeMap(on_task_grid(safe, grid, task), limit_share=values_on_task_grid(most, grid, task))


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


@dataclass(frozen=True, slots=True)
class EveryReturn:
    """Share of unsafe ground that nobody looks at: what any method must beat."""

    name: str = "all seen ground"
    source: str = "none: reference that calls every cell within 0.5 m of a return safe"
    reach_m: float = 0.5

    def judge(self, returns: FlownReturns, task: LandingTask) -> SafeMap:
        seen = fill_gaps(cell_statistics(returns, task.grid).mean_m, self.reach_m / task.grid.cell_m)
        return SafeMap(np.where(np.isfinite(seen), SAFE, UNKNOWN).astype(np.uint8))
