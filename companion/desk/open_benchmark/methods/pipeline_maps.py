"""Maps of `slz.Pipeline` on the task's grid, after the windows of a flight."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from companion.desk.open_benchmark.frozen_scenes import ORIGIN
from companion.desk.open_benchmark.landing_task import F64, U8, UNKNOWN, FlownReturns, LandingTask
from params import Parameters
from slz import LocalFrame, Pipeline, TerrainMaps, Window

FRAME = LocalFrame(*ORIGIN)
NS = 1_000_000_000


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
