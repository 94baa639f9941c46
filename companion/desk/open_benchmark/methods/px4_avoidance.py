"""Safe landing planner of PX4-Avoidance: spread and steps of cells, and a disc of landable ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import minimum_filter, uniform_filter

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
    on_task_grid,
    without_outliers,
)


@dataclass(frozen=True, slots=True)
class Px4Avoidance:
    """Rule of `safe_landing_planner` in PX4-Avoidance (4b30517), with its default numbers.

    A cell of 0.25 m is landable if it has a return and the standard deviation of its heights is at most
    0.2 m. Of the 11 x 11 cells around it more than 70 must be landable, and at most 70 may have a mean that
    differs by more than 0.1 m. The waypoint generator lands where all cells in a disc are so; here the disc
    is that of the task's footprint. The filters over time are left out, since the returns of all windows
    count at once. The original takes empty cells for heights of 0; here they differ from none.
    """

    name: str = "PX4-Avoidance"
    source: str = (
        "PX4-Avoidance, safe_landing_planner (4b30517), default parameters; chosen: outlier"
        " removal of Rusu 2008, disc of the footprint, no filter over time"
    )
    cell_m: float = 0.25
    most_std_m: float = 0.2
    smoothing: int = 5
    least_landable: int = 70
    step_m: float = 0.1
    most_steps: int = 70

    def judge(self, returns: FlownReturns, task: LandingTask) -> SafeMap:
        returns = without_outliers(returns)
        grid = task.grid.with_cells(self.cell_m)
        cells = cell_statistics(returns, grid)
        landable = (cells.count >= 1) & (np.sqrt(np.nan_to_num(cells.variance_m2)) <= self.most_std_m)
        size = 2 * self.smoothing + 1
        n_landable = np.rint(uniform_filter(landable.astype(float), size, mode="constant") * size**2)
        near = around(cells.mean_m, self.smoothing)
        apart = np.abs(near - cells.mean_m[..., None, None]) > self.step_m  # never where one is empty
        good = (n_landable > self.least_landable) & (apart.sum(axis=(2, 3)) <= self.most_steps)
        reach = round(task.footprint_m / 2 / self.cell_m)
        along = np.arange(-reach, reach + 1)
        disc = np.hypot(*np.meshgrid(along, along)) < reach + 0.5
        whole = minimum_filter(good, footprint=disc, mode="constant", cval=False)
        unseen = np.where(n_landable > 0, UNSAFE, UNKNOWN)
        state = np.where(whole, SAFE, unseen).astype(np.uint8)
        return SafeMap(on_task_grid(state, grid, task))
