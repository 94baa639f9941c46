"""The SLZ paper: mean heights of cells, gradient, and a square of safe cells (Sensors 23(7) 3491)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import params
from companion.desk.open_benchmark.landing_task import (
    SAFE,
    UNKNOWN,
    UNSAFE,
    FlownReturns,
    LandingTask,
    SafeMap,
)
from companion.desk.open_benchmark.methods.elevation_grid import (
    footprint_reach,
    footprint_state,
    on_task_grid,
)
from companion.desk.open_benchmark.methods.pipeline_maps import final_maps, sample

LEAST_ZONE_M = 20.0  # of the parameter


@dataclass(frozen=True, slots=True)
class SlzPaper:
    """Rules of the SLZ paper to the letter (`mode=source`): histogram filter, Eq. (3) to (9), total map.

    Cells of 1 m (its near mode), worst slope 40 degrees. The limit of slope is the task's, and the square
    that must be safe is the footprint; Table 4 has 4 degrees and 24 m for a helicopter.
    """

    name: str = "SLZ paper"
    source: str = (
        "Sensors 23(7) 3491, near mode (cells of 1 m); chosen: the task's slope limit and footprint instead"
        " of 4° and 24 m"
    )
    cell_m: float = 1.0

    def judge(self, returns: FlownReturns, task: LandingTask) -> SafeMap:
        grid = task.grid.with_cells(self.cell_m)
        side = 2 * self.cell_m * (max(grid.shape) // 2 + 2)
        own = {
            "mode": "source",
            "cell_m": self.cell_m,
            "zone_m": max(side, LEAST_ZONE_M),
            "min_square_m": 2 * self.cell_m,
            "safe_slope_deg": task.slope_limit_deg,
            "worst_slope_deg": 40.0,
        }
        maps = final_maps(params.load("quadcopter", [f"{k}={v}" for k, v in own.items()]), returns, task)
        if maps is None:
            return SafeMap(np.full(task.grid.shape, UNKNOWN, np.uint8))
        cells = sample(maps, maps.state, LandingTask(grid))
        whole = footprint_state(cells == SAFE, cells == UNSAFE, footprint_reach(task, self.cell_m))
        return SafeMap(on_task_grid(whole, grid, task))


METHOD = SlzPaper()
