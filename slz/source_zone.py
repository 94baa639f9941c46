"""Parameters of a zone of source mode (SLZ paper §3.4.1), and the best point in it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.kernels.bits import unpacked
from slz.kernels.content import part_of
from slz.kernels.fuse import SUM_UNIT
from slz.kernels.groups import obstacles
from slz.kernels.measure import corners, measure
from slz.kernels.room import largest_square, widest
from slz.landing_point import horizon_towards
from slz.source_search import Part, SourceSearch
from slz.source_terrain import SourceTerrain
from slz.surroundings import Obstacle
from slz.zone import LandingPoint, Zone

MOST_OBSTACLES = 200
AROUND = 3  # cells, of the ground that an obstacle's height is over
Bits = NDArray[np.uint64]


def describe_source(
    part: Part,
    terrain: SourceTerrain,
    search: SourceSearch,
    sensor_enu_m: NDArray[np.float64],
    parameters: Parameters,
    zone_id: int,
) -> Zone:
    """Work out everything that is reported of a zone: what lies inside its contour, as in the paper."""
    box, grid, words = part.box, terrain.grid, part.words
    first_row, first_col = part.boundary_cells[0].tolist()
    own = part_of(part.content, terrain.safe_bits, box.row0, words.start, first_row, first_col)
    n_safe, n_unknown, n_own, slopes, roughs = measure(
        part.content, own, terrain.safe_bits, terrain.known_bits, box.row0, words.start,
        terrain.blocks, terrain.slopes, terrain.roughs,
    )  # fmt: skip
    n_certain = n_safe if parameters.certainty_rule == "safe" else part.n_cells - n_unknown
    return Zone(
        id=zone_id,
        box=box,
        cells=unpacked(part.content, box.col0 & 63, box.col1 - box.col0),
        area_m2=float(part.n_cells) * grid.cell_m**2,
        certainty=n_certain / part.n_cells,  # Eq. 16 or 17
        n_safe=n_safe,
        n_unsafe=part.n_cells - n_safe - n_unknown,
        n_uncertain=n_unknown,
        slope_deg=slopes / (float(SUM_UNIT) * n_own),
        roughness=roughs / (float(SUM_UNIT) * n_own),
        boundary_cells=part.boundary_cells,
        corners_enu_m=corners(part.boundary_cells, terrain.heights, grid.west_m, grid.south_m, grid.cell_m),
        obstacles=_obstacles(part, own, terrain),
        best=_best_point(part, own, terrain, search, sensor_enu_m, parameters),
    )


def _best_point(
    part: Part,
    own: Bits,
    terrain: SourceTerrain,
    search: SourceSearch,
    sensor_enu_m: NDArray[np.float64],
    parameters: Parameters,
) -> LandingPoint:
    """Return the point of a zone farthest from everything that is not the zone, see `best_point`."""
    grid, box = terrain.grid, part.box
    squares = search.squares[box.row0 : box.row1, part.words] & own
    side = int(largest_square(squares, search.side))
    found = widest(own, side)
    cells = found[:, :2] + (box.row0, 64 * part.words.start)
    slope = terrain.slopes[cells[:, 0], cells[:, 1]]
    centres = grid.centres(cells)
    first = 0
    if len(cells) > 1:
        way = np.nan_to_num(np.hypot(*(centres - sensor_enu_m[:2]).T))
        first = int(np.lexsort((way // grid.cell_m, np.round(slope, 1)))[0])
    row, col = cells[first].tolist()
    east, north = centres[first].tolist()
    enu_m = np.array([east, north, terrain.heights[row, col]], np.float64)
    return LandingPoint(
        enu_m=enu_m,
        clearance_m=(math.sqrt(found[first, 2]) - 0.5) * grid.cell_m,
        square_side_m=side * grid.cell_m,
        slope_deg=float(slope[first]),
        certainty=1.0,
        horizon_deg=horizon_towards(enu_m, sensor_enu_m, terrain, parameters),
        distance_m=math.hypot(east - sensor_enu_m[0], north - sensor_enu_m[1]),
    )


def _obstacles(part: Part, own: Bits, terrain: SourceTerrain) -> tuple[Obstacle, ...]:
    """Group the measured unsafe cells inside a contour; their height is over the zone around them."""
    grid, box, words = terrain.grid, part.box, part.words
    here = slice(box.row0, box.row1), words
    holes = part.content & terrain.known_bits[here] & ~terrain.safe_bits[here]
    found, ends, cells = obstacles(
        holes, own, terrain.heights, box.row0, 64 * words.start, grid.west_m, grid.south_m, grid.cell_m,
        MOST_OBSTACLES, AROUND,
    )  # fmt: skip
    cells.flags.writeable = False
    return tuple(
        Obstacle(east, north, top, over, cells[first:stop], grid.cell_m)
        for (east, north, top, over), (first, stop) in zip(found.tolist(), ends.tolist(), strict=True)
    )
