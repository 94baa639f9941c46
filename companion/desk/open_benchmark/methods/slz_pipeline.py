"""This project's method: `slz.Pipeline` in default mode, window by window, as in flight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import params
from companion.desk.open_benchmark.landing_task import UNKNOWN, FlownReturns, LandingTask, SafeMap
from companion.desk.open_benchmark.methods.pipeline_maps import final_maps, sample, sample_layer
from companion.desk.survey.point_density import coverage_for, density_per_m2

FOREVER_S = 1e12


@dataclass(frozen=True, slots=True)
class SlzPipeline:
    """Default mode with the quadcopter's profile, on the task's cells and limits."""

    name: str = "slz (this project)"
    source: str = "this repository, default mode, profile quadcopter; probability: its certainty"

    def judge(self, returns: FlownReturns, task: LandingTask) -> SafeMap:
        side = task.grid.cell_m * max(task.grid.shape)
        own = {
            "cell_m": task.grid.cell_m,
            "zone_m": max(side, 40.0),
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


def _of_stored_cloud(parameters: params.Parameters, returns: FlownReturns) -> params.Parameters:
    """Return the parameters as `slz map` sets them: nothing ages, and gaps follow the density."""
    p = parameters
    gap_m = coverage_for(density_per_m2(returns.points_m), p.cell_m, p.coverage_m, p.min_square_m)
    return p.model_copy(update={"max_age_s": FOREVER_S, "coverage_m": gap_m})


METHOD = SlzPipeline()
