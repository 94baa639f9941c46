"""Zone parameters in source mode (SLZ paper, section 3.4.1), and landing point of the zone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Box, Grid
from slz.kernels.paper.zone_statistics import SUM_UNIT, corners, zonal_statistics
from slz.kernels.raster.bitmap import unpacked
from slz.kernels.raster.distance_transform import least_steep, square_and_clearance
from slz.kernels.raster.region_fill import all_reach, component
from slz.landing_point.obstacles import Obstacle
from slz.landing_point.surroundings import horizon_towards
from slz.paper.paper_detection import PaperDetection, Part
from slz.paper.paper_report import Deferred, PaperZone
from slz.paper.paper_terrain import Blocks, PaperTerrain, heights_at, joined
from slz.zone import LandingPoint, Zone
from slz.zones.description import obstacles_of
from slz.zones.tile_view import TileView

Bits = NDArray[np.uint64]


def describe_paper_zone(
    part: Part,
    terrain: PaperTerrain,
    search: PaperDetection,
    sensor_enu_m: NDArray[np.float64],
    parameters: Parameters,
    zone_id: int,
) -> Zone:
    """Describe a zone: all cells inside its contour belong to it, as in the paper."""
    box, grid, words = part.box, terrain.grid, part.words
    first_row, first_col = part.boundary_cells[0].tolist()
    safe, holes = np.empty_like(part.content), np.empty_like(part.content)
    held = np.zeros((((box.row1 - 1) >> 6) + 1 - (box.row0 >> 6), safe.shape[1]), bool)
    n_safe, n_unknown, slopes, roughs = zonal_statistics(
        part.content, terrain.safe_bits, terrain.known_bits, box.row0, words.start,
        terrain.blocks, terrain.slopes, terrain.roughs, safe, holes, held,
    )  # fmt: skip
    own = Deferred(lambda: component(safe, first_row - box.row0, first_col - 64 * words.start))
    blocks = terrain.height_copies.of(box, held)
    n_certain = n_safe if parameters.certainty_rule == "safe" else part.n_cells - n_unknown
    return PaperZone(
        id=zone_id,
        box=box,
        cells=Deferred(lambda: unpacked(part.content, box.col0 & 63, box.col1 - box.col0)),
        area_m2=float(part.n_cells) * grid.cell_m**2,
        certainty=n_certain / part.n_cells,  # SLZ paper, Eq. (16) or SLZ paper, Eq. (17)
        n_safe=n_safe,
        n_unsafe=part.n_cells - n_safe - n_unknown,
        n_uncertain=n_unknown,
        slope_deg=slopes / (float(SUM_UNIT) * n_safe),
        roughness=roughs / (float(SUM_UNIT) * n_safe),
        boundary_cells=part.boundary_cells,
        corners_enu_m=Deferred(
            lambda: corners(
                part.boundary_cells,
                heights_at(blocks, box, part.boundary_cells),
                grid.west_m,
                grid.south_m,
                grid.cell_m,
            )
        ),
        obstacles=Deferred(lambda: _obstacles(holes, own.value(), blocks, box, grid)),
        best=_best_point(part, safe, own, terrain, search, sensor_enu_m, parameters),
    )


def _obstacles(holes: Bits, own: Bits, height_m: Blocks, box: Box, grid: Grid) -> tuple[Obstacle, ...]:
    """Return groups of the measured unsafe cells inside a contour, with heights over the zone around them.

    The sources define no such obstacles.

    Parameters
    ----------
    holes, own
        (rows, words) bitmaps of the unsafe cells and of the zone's own safe ones, from the word of the box's
        first column on.
    height_m
        Blocks of the total DSM that cover the box.
    """
    first, heights = box.col0 >> 6 << 6, joined(height_m, box)
    corner = grid.west_m + first * grid.cell_m, grid.south_m + box.row0 * grid.cell_m
    cells = Box(0, heights.shape[0], 0, heights.shape[1])

    def layer(_: str, whole: Box) -> NDArray[np.float32]:
        below = whole.shape[0] - len(heights)
        return np.pad(heights, ((0, below), (0, 0)), constant_values=np.nan)

    view = TileView.copied(layer, cells, 0, "height_m", "top_m")
    found, _ = obstacles_of(view, cells, own, holes, Grid(*corner, grid.cell_m, *cells.shape))
    return tuple(found)


def _best_point(
    part: Part,
    safe: Bits,
    own: Deferred[Bits],
    terrain: PaperTerrain,
    search: PaperDetection,
    sensor_enu_m: NDArray[np.float64],
    parameters: Parameters,
) -> LandingPoint:
    """Return the point of a zone with the greatest clearance, see `best_point`.

    Cells between a zone and an island in one of its holes belong to neither. So distances are the same with
    and without islands, and an island matters only where the result is on it.
    """
    grid, box, word0 = terrain.grid, part.box, part.words.start
    squares = search.squares[box.row0 : box.row1, part.words] & safe
    side, square, found = square_and_clearance(safe, squares, search.side)
    longest = 4 * len(part.boundary_cells)  # longer than most boundaries of holes
    for cells in (np.array([square]), found):
        if not all_reach(terrain.safe_bits, part.content, box.row0, word0, cells, longest):
            side, _, found = square_and_clearance(own.value(), squares & own.value(), search.side)
            break
    row0, col0 = box.row0, 64 * word0
    at = least_steep(
        found, terrain.slopes, row0, col0, grid.west_m, grid.south_m, grid.cell_m,
        sensor_enu_m[0], sensor_enu_m[1],
    )  # fmt: skip
    down, right, distance2 = found[at].tolist()
    row, col = row0 + down, col0 + right
    east, north = grid.centre(row, col)
    enu_m = np.array([east, north, terrain.heights[col >> 6, row, col & 63]], np.float64)
    return LandingPoint(
        enu_m=enu_m,
        clearance_m=(math.sqrt(distance2) - 0.5) * grid.cell_m,
        square_side_m=side * grid.cell_m,
        slope_deg=float(terrain.slopes[col >> 6, row, col & 63]),
        certainty=1.0,
        horizon_deg=horizon_towards(enu_m, sensor_enu_m, terrain, parameters),
        distance_m=math.hypot(east - sensor_enu_m[0], north - sensor_enu_m[1]),
    )
