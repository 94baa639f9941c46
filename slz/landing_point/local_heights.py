"""Map around the vehicle, small enough for every report: heights, and where it can land.

Obstacle avoidance and the autopilot's own landings cannot wait for a window, so they read this map.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.frame import is_known
from slz.grid import Box
from slz.terrain.terrain_view import TerrainView

REACH_M = 30.0
LEAST_CELL_M = 0.5
FOOT_M = 1.0

Floats = NDArray[np.float32]
Cells = Callable[[Box], NDArray[np.bool_]]


@dataclass(frozen=True, slots=True, eq=False)
class Nearby:
    """Read-only heights on a square around the vehicle; row 0 is the southernmost, NaN where unknown.

    ground_m: (rows, cols) float32, mean height of the returns of the highest map cell in each block, up in
    the map frame. top_m: (rows, cols) float32, highest return of the block; on safe ground equal to the mean
    height. landable: (rows, cols) bool, True where the vehicle can land on any cell of the block, missed by
    the touchdown error.
    """

    west_m: float
    south_m: float
    cell_m: float
    ground_m: Floats
    top_m: Floats
    landable: NDArray[np.bool_]

    def ground_below_m(self, enu_m: NDArray[np.float64]) -> float:
        """Return the median height of the ground within 1 m of a point (2,) or (3,); NaN where unknown."""
        row = (float(enu_m[1]) - self.south_m) / self.cell_m - 0.5
        col = (float(enu_m[0]) - self.west_m) / self.cell_m - 0.5
        reach = FOOT_M / self.cell_m
        if not math.isfinite(row + col):
            return math.nan
        rows, cols = (
            slice(max(0, math.ceil(at - reach)), max(0, math.floor(at + reach) + 1)) for at in (row, col)
        )
        part = self.ground_m[rows, cols]
        known = np.sort(part[~np.isnan(part)])
        if not len(known):
            return math.nan
        return float((known[(len(known) - 1) // 2] + known[len(known) // 2]) / 2)

    def columns_enu_m(self, above_m: float) -> NDArray[np.float64]:
        """Return (n, 3) centres and tops of the cells that reach higher than `above_m`."""
        rows, cols = np.nonzero(self.top_m > above_m)  # False for NaN
        east = self.west_m + (cols + 0.5) * self.cell_m
        north = self.south_m + (rows + 0.5) * self.cell_m
        return np.stack([east, north, self.top_m[rows, cols].astype(np.float64)], axis=1)


def nearby(
    near: TerrainView,
    far: TerrainView,
    sensor_enu_m: NDArray[np.float64],
    safe: Cells,
    error_m: float,
) -> Nearby | None:
    """Return the map around the sensor, with the far map's heights where the near one knows none.

    Parameters
    ----------
    near, far
        Both maps, of any cell size.
    sensor_enu_m
        (3,) east, north, up; None is returned where it is not finite.
    safe
        Returns which cells of a box of the near map the vehicle may land on.
    error_m
        Touchdown error: every cell within it must be safe.
    """
    if not is_known(sensor_enu_m):
        return None
    cell_m = near.grid.cell_m
    block = max(1, math.ceil(LEAST_CELL_M / cell_m - 1e-9))
    count = math.ceil(REACH_M / (block * cell_m))
    row, col = near.grid.index(float(sensor_enu_m[0]), float(sensor_enu_m[1]))
    box = Box(row - count * block, row + count * block, col - count * block, col + count * block)
    ground, top = (_blocks(layer, block) for layer in near.ground_and_top(box))
    west = near.grid.west_m + box.col0 * cell_m
    south = near.grid.south_m + box.row0 * cell_m
    _fill(ground, top, far, west, south, block * cell_m)
    landable = _landable(safe, box, block, math.ceil(error_m / cell_m - 1e-9))
    for array in (ground, top, landable):
        array.setflags(write=False)
    return Nearby(west, south, block * cell_m, ground, top, landable)


def _landable(safe: Cells, box: Box, block: int, error: int) -> NDArray[np.bool_]:
    """Return the blocks of a box all of whose cells, and all within an error of cells, are safe."""
    wide = safe(Box(box.row0 - error, box.row1 + error, box.col0 - error, box.col1 + error))
    side = block + 2 * error
    across = np.logical_and.reduce([wide[row : row + box.shape[0] : block] for row in range(side)])
    landable = [across[:, col : col + box.shape[1] : block] for col in range(side)]
    return np.asarray(np.logical_and.reduce(landable))


def _blocks(layer: Floats, side: int) -> Floats:
    """Return the maximum of each block of cells, NaN where no cell is known."""
    out = layer[::side, ::side].copy()
    for row, col in itertools.product(range(side), repeat=2):
        np.fmax(out, layer[row::side, col::side], out=out)
    return out


def _fill(
    ground: Floats, top: Floats, far: TerrainView, west_m: float, south_m: float, cell_m: float
) -> None:
    """Write the far map's heights into the cells that are unknown."""
    rows, cols = np.nonzero(np.isnan(ground))
    if not len(rows):
        return
    grid = far.grid
    far_row = np.floor((south_m + (rows + 0.5) * cell_m - grid.south_m) / grid.cell_m).astype(np.intp)
    far_col = np.floor((west_m + (cols + 0.5) * cell_m - grid.west_m) / grid.cell_m).astype(np.intp)
    box = Box(int(far_row.min()), int(far_row.max()) + 1, int(far_col.min()), int(far_col.max()) + 1)
    far_ground, far_top = far.ground_and_top(box)
    ground[rows, cols] = far_ground[far_row - box.row0, far_col - box.col0]
    top[rows, cols] = far_top[far_row - box.row0, far_col - box.col0]
