"""This project's pipeline as methods of the benchmark: default mode, and the SLZ paper to the letter."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import params
from companion.desk.open_benchmark.frozen_scenes import ORIGIN
from companion.desk.open_benchmark.landing_task import (
    F64,
    SAFE,
    U8,
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
from companion.desk.survey.cloud_quality import coverage_for, density_per_m2
from params import Parameters
from slz import LocalFrame, Pipeline, TerrainMaps, Window

FRAME = LocalFrame(*ORIGIN)
NS = 1_000_000_000

LEAST_PAPER_ZONE_M = 20.0  # least value of the parameter zone_m in source mode

FOREVER_S = 1e12
LEAST_ZONE_M = 40.0


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
            "zone_m": max(side, LEAST_PAPER_ZONE_M),
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


def final_maps(parameters: Parameters, returns: FlownReturns, task: LandingTask) -> TerrainMaps | None:
    """Return the finest near map after all windows, in order, as in flight; None without returns."""
    grid = task.grid
    centre = grid.west_m + grid.cols * grid.cell_m / 2, grid.south_m + grid.rows * grid.cell_m / 2
    pipeline = Pipeline(parameters, centre, follow=False)
    for window in _windows(returns):
        pipeline.process(window)
        pipeline.prepare()
    return pipeline.maps(None, "near", None if parameters.mode == "source" else 0)


def _windows(returns: FlownReturns) -> Iterator[Window]:
    for k, sensor in enumerate(returns.sensors_m):
        mine = returns.window == k
        if not mine.any():
            continue
        points = np.ascontiguousarray(returns.points_m[mine])
        stamps = np.rint(returns.stamp_s[mine] * NS).astype(np.int64)
        points.setflags(write=False)
        yield Window(points, stamps, sensor.copy(), FRAME, int(stamps[0]), int(stamps[-1]))


def sample(maps: TerrainMaps, state: U8, task: LandingTask) -> U8:
    """Return states of a map at the centres of the task's cells; unknown outside it."""
    return np.asarray(_at(maps, state, task, UNKNOWN), np.uint8)


def sample_layer(maps: TerrainMaps, layer: str, task: LandingTask) -> F64:
    """Return a layer at the centres of the task's cells; NaN outside the map."""
    return _at(maps, maps.layers[layer].astype(np.float64), task, np.nan)


def _at(maps: TerrainMaps, values: F64 | U8, task: LandingTask, outside: float) -> F64:
    x, y = task.grid.centres()
    cell = maps.grid.cell_m
    col = np.floor((x - maps.west_m) / cell + 1e-6).astype(np.int64)
    row = np.floor((y - maps.south_m) / cell + 1e-6).astype(np.int64)
    inside = (row >= 0) & (col >= 0) & (row < values.shape[0]) & (col < values.shape[1])
    out = np.full(task.grid.shape, outside)
    out[inside] = values[row[inside], col[inside]]
    return out


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
