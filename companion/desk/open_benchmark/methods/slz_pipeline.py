"""This project's method: `slz.Pipeline` in default mode, window by window, as in flight."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

import params
from companion.desk.open_benchmark.landing_task import UNKNOWN, FlownReturns, LandingTask, SafeMap
from companion.desk.open_benchmark.methods.pipeline_maps import final_maps, sample, sample_layer
from companion.desk.survey.point_density import coverage_for, density_per_m2

FOREVER_S = 1e12
LEAST_ZONE_M = 40.0


@dataclass(frozen=True, slots=True)
class SlzPipeline:
    """Default mode with the quadcopter's profile, on the task's cells and limits."""

    name: str = "slz (this project)"
    source: str = "this repository, default mode, profile quadcopter; probability: its certainty"

    def judge(self, returns: FlownReturns, task: LandingTask) -> SafeMap:
        own = {
            "cell_m": task.grid.cell_m,
            "zone_m": _zone_m(returns, task),
            "footprint_m": task.footprint_m,
            "safe_slope_deg": task.slope_limit_deg,
            "relief_m": task.relief_limit_m,
        }
        parameters = params.load("quadcopter", [f"{k}={v}" for k, v in own.items()])
        if np.isnan(returns.sensors_m).any():
            parameters = _of_stored_cloud(parameters, returns)
        maps = final_maps(parameters, returns, task)
        if maps is None:
            return SafeMap(np.full(task.grid.shape, UNKNOWN, np.uint8))
        state = sample(maps, maps.state, task)
        certainty = np.where(state == UNKNOWN, np.nan, sample_layer(maps, "certainty", task))
        return SafeMap(state, certainty.astype(np.float32))


def _zone_m(returns: FlownReturns, task: LandingTask) -> float:
    """Return the side of a map that holds the task's grid and does not move.

    A map moves when the vehicle is nearer to its edge than a quarter of its side.
    """
    grid = task.grid
    middle = grid.west_m + grid.cols * grid.cell_m / 2, grid.south_m + grid.rows * grid.cell_m / 2
    away = np.abs(returns.sensors_m[:, :2] - middle)
    farthest = float(np.nanmax(away)) if np.isfinite(away).any() else 0.0
    step = 2 * grid.cell_m
    still = step * math.ceil((4 * farthest + step) / step)
    return max(grid.cell_m * max(grid.shape), LEAST_ZONE_M, still)


def _of_stored_cloud(parameters: params.Parameters, returns: FlownReturns) -> params.Parameters:
    """Return the parameters as `slz map` sets them: nothing ages, and gaps follow the density."""
    p = parameters
    gap_m = coverage_for(density_per_m2(returns.points_m), p.cell_m, p.coverage_m, p.min_square_m)
    return p.model_copy(update={"max_age_s": FOREVER_S, "coverage_m": gap_m})


METHOD = SlzPipeline()
