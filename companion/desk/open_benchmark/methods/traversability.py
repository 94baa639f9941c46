"""Traversability of grid_map: slope, roughness and step of an elevation map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from companion.desk.open_benchmark.landing_task import F64, FlownReturns, LandingTask, SafeMap
from companion.desk.open_benchmark.methods.elevation_grid import (
    around,
    cell_statistics,
    fill_gaps,
    footprint_most,
    footprint_reach,
    footprint_state,
    without_outliers,
)


@dataclass(frozen=True, slots=True)
class Traversability:
    """Slope, roughness and step filters, each 1 on level ground and 0 from its critical value on.

    Wermelinger et al., Navigation planning for legged robots in challenging terrain, IROS 2016, and its
    filters for grid_map (traversability_estimation). Normals and roughness are those of a disc; the step is
    the greatest range of heights in a window about the cells of a second window, scaled down where fewer
    than four of them are critical. Critical values are the task's limits, for roughness 0.05 m as published;
    radii are those of the publication in cells. A footprint is safe if no filter is 0 in any of its cells.
    """

    name: str = "grid_map traversability"
    source: str = (
        "Wermelinger et al. 2016 (IROS), traversability_estimation; chosen: outlier removal of Rusu"
        " 2008, critical slope and step of the task, radii by cells"
    )
    roughness_m: float = 0.05
    radius_cells: float = 2.5
    step_radius_cells: float = 2.0
    critical_cells: int = 4
    gap_cells: float = 2.0

    def judge(self, returns: FlownReturns, task: LandingTask) -> SafeMap:
        returns = without_outliers(returns)
        height = fill_gaps(cell_statistics(returns, task.grid).mean_m, self.gap_cells)
        slope, rough = _normals(height, self.radius_cells, task.grid.cell_m)
        step = self._step(height, task.relief_limit_m)
        known = np.isfinite(slope) & np.isfinite(step)
        bad = (slope >= task.slope_limit_deg) | (rough >= self.roughness_m) | (step >= task.relief_limit_m)
        reach = footprint_reach(task, task.grid.cell_m)
        shares = (slope / task.slope_limit_deg, rough / self.roughness_m, step / task.relief_limit_m)
        most = footprint_most(np.maximum.reduce(shares), reach)
        state = footprint_state(known & ~bad, known & bad, reach)
        return SafeMap(state, limit_share=most.astype(np.float32))

    def _step(self, height: F64, critical_m: float) -> F64:
        near, inside = _disc(height, self.step_radius_cells)
        span = np.fmax.reduce(near[..., inside], axis=-1) - np.fmin.reduce(near[..., inside], axis=-1)
        spans, _ = _disc(span, self.step_radius_cells)
        most = np.fmax.reduce(spans[..., inside], axis=-1)
        n_critical = (spans[..., inside] > critical_m).sum(axis=-1)
        return np.asarray(np.minimum(most, n_critical / self.critical_cells * most))


def _disc(values: F64, radius: float) -> tuple[F64, NDArray[np.bool_]]:
    """Return each cell's neighbourhood and the mask of a disc in it."""
    reach = int(radius)
    along = np.arange(-reach, reach + 1)
    inside = np.hypot(*np.meshgrid(along, along)) <= radius
    return around(values, reach), inside


def _normals(height: F64, radius: float, cell_m: float) -> tuple[F64, F64]:
    """Return slope (deg) of the plane of a disc, and the standard deviation of the distances to it."""
    near, inside = _disc(height, radius)
    reach = int(radius)
    north, east = (cell_m * (v - reach).astype(np.float64) for v in np.nonzero(inside))
    z = near[..., inside]
    here = np.isfinite(z)
    n = np.maximum(here.sum(axis=-1), 1)[..., None]

    def centred(values: F64) -> F64:
        values = np.where(here, values, 0.0)
        return np.where(here, values - values.sum(axis=-1, keepdims=True) / n, 0.0)

    x, y, h = centred(east), centred(north), centred(z)
    xx, yy, xy = (x * x).sum(-1), (y * y).sum(-1), (x * y).sum(-1)
    xh, yh = (x * h).sum(-1), (y * h).sum(-1)
    det = xx * yy - xy * xy
    with np.errstate(divide="ignore", invalid="ignore"):
        gx, gy = (yy * xh - xy * yh) / det, (xx * yh - xy * xh) / det
    gx[det < 1e-9] = gy[det < 1e-9] = np.nan
    rest = np.where(here, h - gx[..., None] * x - gy[..., None] * y, 0.0)
    length = np.sqrt(1 + gx**2 + gy**2)
    rough = np.sqrt((rest**2).sum(-1) / np.maximum(n[..., 0] - 1, 1)) / length
    return np.degrees(np.arctan(np.hypot(gx, gy))), rough
