"""Ground, obstacles and horizon around a point."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from params import Parameters
from slz.frame import is_known
from slz.grid import Box, common
from slz.kernels.raster.bitmap import packed
from slz.kernels.raster.connected_components import highest_cells, largest_groups
from slz.kernels.raster.horizon import box_ahead
from slz.landing_point.obstacles import SECTORS, Obstacle, Obstacles, horizon_at
from slz.terrain.terrain import EvidenceTerrain
from slz.terrain.terrain_maps import SAFE
from slz.terrain.terrain_view import TerrainView

MOST_OBSTACLES = 64
BULGE = 0.02  # allowed rise of the ground over its plane, per metre of distance


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Obstacles within `radius_m` of a point, the nearest first, and its horizon.

    horizon_deg : (36,) elevation angles by bearing, clockwise from north; NaN where nothing was seen.
    """

    radius_m: float
    obstacles: tuple[Obstacle, ...]
    horizon_deg: NDArray[np.float64]

    def way_in(self, bearing_rad: float = 0.0) -> tuple[float, float] | None:
        """Return the approach bearing (rad) with the lowest horizon, and that horizon (deg).

        Horizons are the maximum over three neighbouring sectors, compared in steps of 2 degrees. Of equal
        ones the bearing nearest to `bearing_rad` wins. None where no sector was seen.
        """
        h = self.horizon_deg
        wide = np.max([np.roll(h, -1), h, np.roll(h, 1)], axis=0)  # NaN where one of the three is NaN
        bearings = np.arange(SECTORS) * 2 * np.pi / SECTORS
        turn = np.abs((bearings - bearing_rad + np.pi) % (2 * np.pi) - np.pi)
        seen = np.flatnonzero(np.isfinite(wide))
        if not len(seen):
            return None
        best = min(seen.tolist(), key=lambda i: (np.floor(max(wide[i], 0.0) / 2), turn[i]))
        return float(bearings[best]), float(wide[best])


def cell_of(enu_m: NDArray[np.float64], terrain: TerrainView) -> Box:
    row, col = terrain.grid.index(float(enu_m[0]), float(enu_m[1]))
    return Box(row, row + 1, col, col + 1)


def ground_m(terrain: TerrainView, cell: Box) -> float:
    """Return the height of the ground at a cell; without one, the median of its nearest known neighbours."""
    for radius in range(4):
        heights = terrain.layer("height_m", terrain.around(cell, radius))
        known = heights[np.isfinite(heights)]
        if len(known):
            return float(np.median(known) if radius else known[0])
    return float("nan")


def surroundings(enu_m: NDArray[np.float64], terrain: TerrainView, parameters: Parameters) -> Surroundings:
    """Return what stands within `surround_m` of a point, over the plane of the ground about it.

    Obstacles rise over the plane of the ground by more than the relief limit plus 2 % of the distance. The
    ground is the safe component of the point's own cell, or every safe cell where that cell is not safe.
    """
    grid, reach = terrain.grid, math.ceil(parameters.surround_m / terrain.grid.cell_m)
    cell = cell_of(enu_m, terrain)
    box = terrain.around(cell, reach)
    top = _tops(terrain, box)
    rows, cols = np.mgrid[box.row0 : box.row1, box.col0 : box.col1]
    north, east = (rows - cell.row0) * grid.cell_m, (cols - cell.col0) * grid.cell_m
    distance = np.hypot(east, north)
    level_m = float(enu_m[2]) if np.isfinite(enu_m[2]) else ground_m(terrain, cell)
    plane = _plane(east, north, terrain.layer("height_m", box), _own_ground(terrain, box, cell), level_m)
    raised = (top - plane > parameters.relief_m + BULGE * distance) & (distance <= parameters.surround_m)

    groups, cells = largest_groups(packed(raised.view(np.uint8)), MOST_OBSTACLES)
    tops_m = top[cells[:, 0], cells[:, 1]]
    highest = highest_cells(tops_m, groups)
    over_m = tops_m[highest].astype(np.float64) - plane[cells[highest, 0], cells[highest, 1]]
    cells += np.array([box.row0, box.col0], np.int32)
    found = Obstacles(grid, cells, groups[:, 4:], highest, tops_m[highest], over_m)
    nearest = sorted(found, key=lambda obstacle: obstacle.distance_m(enu_m))
    here = np.array([enu_m[0], enu_m[1], plane[cell.row0 - box.row0, cell.col0 - box.col0]])
    half_m = parameters.footprint_m / 2
    view = horizon_at(here, _view(terrain, box), grid, box, half_m, parameters.surround_m)
    return Surroundings(parameters.surround_m, tuple(nearest), view)


def _tops(terrain: TerrainView, box: Box) -> NDArray[np.float32]:
    height, top = terrain.layer("height_m", box), terrain.layer("top_m", box)
    return np.where(np.isnan(top), height, top)


def _view(terrain: TerrainView, box: Box) -> NDArray[np.float32]:
    """Return the heights that may block the view: mean heights on safe ground, tops elsewhere."""
    return np.where(terrain.state(box) == SAFE, terrain.layer("height_m", box), _tops(terrain, box))


def _own_ground(terrain: TerrainView, box: Box, cell: Box) -> NDArray[np.bool_]:
    safe = terrain.state(box) == SAFE
    label, _ = ndimage.label(safe, np.ones((3, 3)))
    own = label[cell.row0 - box.row0, cell.col0 - box.col0]
    return np.asarray(label == own) if own else safe


def _plane(
    east: NDArray[np.float64],
    north: NDArray[np.float64],
    height: NDArray[np.float32],
    ground: NDArray[np.bool_],
    level_m: float,
) -> NDArray[np.float64]:
    """Return the plane fitted to the ground, or the level where fewer than 30 cells of ground are known."""
    use = ground & np.isfinite(height)
    if int(use.sum()) < 30:
        return np.full(height.shape, level_m)
    design = np.column_stack([np.ones(int(use.sum())), east[use], north[use]])
    fit = np.linalg.lstsq(design.T @ design, design.T @ height[use].astype(np.float64), rcond=None)[0]
    return np.asarray(fit[0] + fit[1] * east + fit[2] * north)


def horizon_towards(
    enu_m: NDArray[np.float64],
    sensor_enu_m: NDArray[np.float64],
    terrain: TerrainView,
    parameters: Parameters,
) -> float:
    """Return the elevation angle (deg) of the highest obstacle within 15 degrees of the way to the sensor."""
    if not (is_known(enu_m) and is_known(sensor_enu_m)):
        return float("nan")
    east, north = (sensor_enu_m[:2] - enu_m[:2]).tolist()
    way, grid = math.hypot(east, north), terrain.grid
    reach, cell = math.ceil(parameters.surround_m / grid.cell_m), cell_of(enu_m, terrain)
    reach_m = parameters.footprint_m / 2, parameters.surround_m
    if not way > 0:
        towards, box = (0.0, 0.0), terrain.around(cell, reach)
    else:
        towards = east / way, north / way
        box = Box(*box_ahead(cell.row0, cell.col0, reach, *towards))
        if isinstance(terrain, EvidenceTerrain):
            return math.degrees(terrain.horizon(enu_m, box, *reach_m, SECTORS, towards))
        box = common(box, terrain.around(cell, reach))
    view = horizon_at(enu_m, _view(terrain, box), grid, box, *reach_m)
    sector = round(math.atan2(east, north) / (2 * math.pi / len(view)))
    ahead = view[[(sector + step) % len(view) for step in (-1, 0, 1)]]
    return float(np.nanmax(ahead)) if np.isfinite(ahead).any() else float("nan")
