"""Landing point of a zone, and state of the selected landing point (SLP; SLZ thesis, section 4.3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from params import Parameters
from slz.frame import is_known
from slz.grid import Box
from slz.kernels.raster.bitmap import packed
from slz.kernels.raster.distance_transform import greatest_clearance, most_certain
from slz.landing_point.obstacles import Surroundings, grouped, horizon_at
from slz.terrain.terrain_maps import SAFE, UNKNOWN, UNSAFE
from slz.terrain.terrain_view import CellView, TerrainView
from slz.zone import LandingPoint
from slz.zones.detection import Candidate

Judge = Literal["near", "far", "none"]
MOST_OBSTACLES = 64
BULGE = 0.02  # allowed rise of the ground over its plane, per metre of distance


class PointState(Enum):
    """State of a selected point."""

    SAFE = "safe"
    UNSAFE = "unsafe"
    UNKNOWN = "unknown"


STATES = {
    int(SAFE): PointState.SAFE,
    int(UNSAFE): PointState.UNSAFE,
    int(UNKNOWN): PointState.UNKNOWN,
}


@dataclass(frozen=True, slots=True)
class SelectedPoint:
    """State of the selected landing point after a window.

    judged_by: the map that decided; "none" when neither covers the point: the state is then the last one
    known (SLZ thesis, section 4.3.2.2), or unknown if there was none. height_m: height of the ground at the
    point. slope_deg, relief_m, certainty: of the footprint at the point, NaN where unknown. surroundings:
    None where nothing is known.
    """

    enu_m: NDArray[np.float64]
    state: PointState
    judged_by: Judge
    height_m: float
    slope_deg: float
    relief_m: float
    certainty: float
    zone_id: int | None
    surroundings: Surroundings | None


@dataclass(frozen=True, slots=True, eq=False)
class GreatestClearance:
    """Cells of a zone with the greatest clearance, with their slope and certainty.

    cells: (n, 2) rows and columns of the grid. distance2: squared distance to the nearest cell outside the
    zone, in cells. slope_deg: 90 where unknown.
    """

    cells: NDArray[np.int64]
    distance2: NDArray[np.int64]
    slope_deg: NDArray[np.float32]
    certainty: NDArray[np.float32]


def greatest_clearance_of(candidate: Candidate, terrain: CellView) -> GreatestClearance:
    """Return the cells whose clearance is within half a cell of the greatest."""
    wide = candidate.words_box
    found = greatest_clearance(candidate.own_bits, candidate.square_side)
    cells = found[:, :2] + np.array([wide.row0, wide.col0])
    return GreatestClearance(
        cells=cells,
        distance2=found[:, 2],
        slope_deg=np.nan_to_num(terrain.layer_at("slope_deg", cells), nan=90.0),
        certainty=terrain.layer_at("certainty", cells),
    )


def best_point(
    among: GreatestClearance,
    square_side: int,
    terrain: CellView,
    sensor_enu_m: NDArray[np.float64],
    parameters: Parameters,
) -> LandingPoint:
    """Return the point of a zone with the greatest clearance.

    Among points whose clearance differs by less than half a cell, the most certain wins, then the least
    steep, then the nearest to the vehicle.

    Parameters
    ----------
    square_side
        Side of the zone's largest square, in cells.
    """
    grid, (east_m, north_m) = terrain.grid, sensor_enu_m[:2].tolist()
    place = grid.west_m, grid.south_m, grid.cell_m
    best = most_certain(among.cells, among.certainty, among.slope_deg, *place, east_m, north_m)
    row, col = among.cells[best].tolist()
    centre = grid.centre(row, col)
    enu_m = np.array([*centre, ground_m(terrain, Box(row, row + 1, col, col + 1))])
    return LandingPoint(
        enu_m=enu_m,
        clearance_m=(math.sqrt(among.distance2[best]) - 0.5) * grid.cell_m,
        square_side_m=square_side * grid.cell_m,
        slope_deg=float(among.slope_deg[best]),
        certainty=float(among.certainty[best]),
        horizon_deg=horizon_towards(enu_m, sensor_enu_m, terrain, parameters),
        distance_m=math.hypot(centre[0] - east_m, centre[1] - north_m),
    )


def ground_m(terrain: TerrainView, cell: Box) -> float:
    """Return the height of the ground at a cell; without one, the median of its nearest known neighbours."""
    for radius in range(4):
        heights = terrain.layer("height_m", terrain.around(cell, radius))
        known = heights[np.isfinite(heights)]
        if len(known):
            return float(np.median(known) if radius else known[0])
    return float("nan")


def judge_point(
    enu_m: NDArray[np.float64], near: TerrainView, far: TerrainView, parameters: Parameters
) -> SelectedPoint | None:
    """Judge a selected point anew; None where neither map has it.

    Where the near map has it, that one decides, else the far map (SLZ thesis, section 4.3.2.3). In default
    mode the point is safe only when every cell within the touchdown error is safe.
    """
    maps: tuple[tuple[Judge, TerrainView], ...] = (("near", near), ("far", far))
    for name, terrain in maps:
        state = terrain.state_at(enu_m, parameters.touchdown_error_m)
        if state is not None:
            cell = _cell(enu_m, terrain)
            return SelectedPoint(
                enu_m=enu_m,
                state=STATES[state],
                judged_by=name,
                height_m=ground_m(terrain, cell),
                slope_deg=float(terrain.layer("slope_deg", cell)[0, 0]),
                relief_m=float(terrain.layer("relief_m", cell)[0, 0]),
                certainty=float(terrain.layer("certainty", cell)[0, 0]),
                zone_id=None,
                surroundings=surroundings(enu_m, terrain, parameters),
            )
    return None


def unknown(enu_m: NDArray[np.float64], height_m: float = math.nan) -> SelectedPoint:
    """Return the state of a point that no map covers."""
    nan = math.nan
    return SelectedPoint(enu_m, PointState.UNKNOWN, "none", height_m, nan, nan, nan, None, None)


def _cell(enu_m: NDArray[np.float64], terrain: TerrainView) -> Box:
    row, col = terrain.grid.index(float(enu_m[0]), float(enu_m[1]))
    return Box(row, row + 1, col, col + 1)


def surroundings(enu_m: NDArray[np.float64], terrain: TerrainView, parameters: Parameters) -> Surroundings:
    """Return what stands within `surround_m` of a point, over the plane of the ground about it.

    Obstacles rise over the plane of the ground by more than the relief limit plus 2 % of the distance. The
    ground is the safe component of the point's own cell, or every safe cell where that cell is not safe.
    """
    grid, reach = terrain.grid, math.ceil(parameters.surround_m / terrain.grid.cell_m)
    cell = _cell(enu_m, terrain)
    box = terrain.around(cell, reach)
    top = _tops(terrain, box)
    rows, cols = np.mgrid[box.row0 : box.row1, box.col0 : box.col1]
    north, east = (rows - cell.row0) * grid.cell_m, (cols - cell.col0) * grid.cell_m
    distance = np.hypot(east, north)
    level_m = float(enu_m[2]) if np.isfinite(enu_m[2]) else ground_m(terrain, cell)
    plane = _plane(east, north, terrain.layer("height_m", box), _own_ground(terrain, box, cell), level_m)
    raised = (top - plane > parameters.relief_m + BULGE * distance) & (distance <= parameters.surround_m)

    def grounds(_: NDArray[np.int64], highest: NDArray[np.int32]) -> NDArray[np.float64]:
        return plane[highest[:, 0] - box.row0, highest[:, 1] - box.col0]

    def tops(cells: NDArray[np.int32]) -> NDArray[np.float32]:
        return top[cells[:, 0] - box.row0, cells[:, 1] - box.col0]

    found = grouped(packed(raised.view(np.uint8)), tops, grounds, grid, box, MOST_OBSTACLES)
    nearest = sorted(found.over(0.0), key=lambda obstacle: obstacle.distance_m(enu_m))
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
    way = math.hypot(east, north)
    towards = (east / way, north / way) if way > 0 else (0.0, 0.0)
    reach = math.ceil(parameters.surround_m / terrain.grid.cell_m)
    box = _ahead(terrain.around(_cell(enu_m, terrain), reach), _cell(enu_m, terrain), reach, *towards)
    half_m = parameters.footprint_m / 2
    view = horizon_at(enu_m, _view(terrain, box), terrain.grid, box, half_m, parameters.surround_m, towards)
    sector = round(math.atan2(east, north) / (2 * math.pi / len(view)))
    ahead = view[[(sector + step) % len(view) for step in (-1, 0, 1)]]
    return float(np.nanmax(ahead)) if np.isfinite(ahead).any() else float("nan")


def _ahead(box: Box, cell: Box, reach: int, east: float, north: float) -> Box:
    """Return the part of a box around a cell that may hold cells within 45 degrees of a direction."""
    bearing = math.atan2(east, north)
    edges = (bearing - math.pi / 4, bearing + math.pi / 4)
    axes = [k * math.pi / 2 for k in range(-4, 5) if edges[0] <= k * math.pi / 2 <= edges[1]]
    if not (east or north):
        return box
    rows = [0.0, *(reach * math.cos(angle) for angle in (*edges, *axes))]
    cols = [0.0, *(reach * math.sin(angle) for angle in (*edges, *axes))]
    return Box(
        max(box.row0, cell.row0 + math.floor(min(rows)) - 1),
        min(box.row1, cell.row1 + math.ceil(max(rows)) + 1),
        max(box.col0, cell.col0 + math.floor(min(cols)) - 1),
        min(box.col1, cell.col1 + math.ceil(max(cols)) + 1),
    )
