"""Ground around the selected point, for a look at every scan between two windows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box
from slz.terrain.terrain_view import TerrainView

AROUND_M = 4.0  # of ground beyond what is watched, by which a shift of all heights is told


@dataclass(frozen=True, slots=True, eq=False)
class WatchedGround:
    """Read-only heights around a point, of the map's cells; row 0 is the southernmost.

    top_m: (rows, cols) float32, what stands there or the ground itself, up in the map frame; NaN where
    unknown. radius_m: horizontal distance from the point within which nothing may come. least_m: height over
    the ground from which something is an obstacle. angle_noise_rad: standard deviation of a ray's direction.
    """

    enu_m: NDArray[np.float64]
    west_m: float
    south_m: float
    cell_m: float
    top_m: NDArray[np.float32]
    radius_m: float
    least_m: float
    angle_noise_rad: float

    def over_m(self, points_enu_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the heights (n,) of points over their cells, NaN where these are unknown or not here."""
        col = np.floor((points_enu_m[:, 0] - self.west_m) / self.cell_m).astype(np.intp)
        row = np.floor((points_enu_m[:, 1] - self.south_m) / self.cell_m).astype(np.intp)
        rows, cols = self.top_m.shape
        here = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
        over = np.full(len(points_enu_m), np.nan)
        over[here] = points_enu_m[here, 2] - self.top_m[row[here], col[here]]
        return over


def watched_ground(
    enu_m: NDArray[np.float64],
    terrain: TerrainView,
    *,
    radius_m: float,
    least_m: float,
    angle_noise_rad: float,
) -> WatchedGround:
    """Return the ground of a map around a point (3,)."""
    grid = terrain.grid
    row, col = grid.index(float(enu_m[0]), float(enu_m[1]))
    reach = math.ceil((radius_m + AROUND_M) / grid.cell_m)
    box = Box(row - reach, row + reach + 1, col - reach, col + reach + 1)
    ground, top = terrain.ground_and_top(box)
    tops = np.fmax(ground, top)
    tops.setflags(write=False)
    west_m, south_m = grid.west_m + box.col0 * grid.cell_m, grid.south_m + box.row0 * grid.cell_m
    return WatchedGround(enu_m, west_m, south_m, grid.cell_m, tops, radius_m, least_m, angle_noise_rad)
