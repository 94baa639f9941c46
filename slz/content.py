"""Parameters of a zone: counts, certainty, roughness, obstacles, room to land (SLZ paper §3.4.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.boundary import without_collinear
from slz.grid import Box, Grid
from slz.kernels.bits import Bits
from slz.kernels.groups import middle_height
from slz.kernels.tally import CERTAINTY, ROUGHNESS, SLOPE, tally
from slz.landing_point import Terrain, best_point
from slz.maps import SAFE, UNSAFE
from slz.search import Candidate
from slz.surroundings import Obstacle, grouped
from slz.zone import Zone

MOST_OBSTACLES = 200
AROUND = 3  # cells, of the ground that an obstacle's height is over


def describe(
    candidate: Candidate,
    terrain: Terrain,
    sensor_enu_m: NDArray[np.float64],
    parameters: Parameters,
    zone_id: int,
) -> Zone:
    """Work out everything that is reported of a candidate.

    The zone is its safe cells; counts, certainty and obstacles are of the cells inside the contour.
    """
    box, grid = candidate.box, terrain.grid
    height, top = terrain.layer("height_m", box), terrain.layer("top_m", box)
    slope, certainty = terrain.layer("slope_deg", box), terrain.layer("certainty", box)
    told, holes, ground = tally(
        candidate.component, candidate.content, terrain.state(box), SAFE, UNSAFE,
        certainty, slope, terrain.layer("roughness", box), height,
    )  # fmt: skip
    n_own, n_all, n_safe, n_unsafe = map(int, told[:CERTAINTY])
    return Zone(
        id=zone_id,
        box=box,
        cells=candidate.component,
        area_m2=n_own * grid.cell_m**2,
        certainty=float(told[CERTAINTY]),
        n_safe=n_safe,
        n_unsafe=n_unsafe,
        n_uncertain=n_all - n_safe - n_unsafe,
        slope_deg=float(told[SLOPE]),
        roughness=float(told[ROUGHNESS]),
        boundary_cells=candidate.boundary_cells,
        corners_enu_m=_with_heights(without_collinear(candidate.boundary_cells), height, box, grid),
        obstacles=_obstacles(holes, ground, height, top, grid, box),
        best=best_point(candidate, slope, certainty, terrain, sensor_enu_m, parameters),
    )


def _with_heights(
    cells: NDArray[np.int32], height_m: NDArray[np.float32], box: Box, grid: Grid
) -> NDArray[np.float64]:
    """Return (n, 3) centres of cells; where no return lies the mean of the others' heights stands in."""
    height = height_m[cells[:, 0] - box.row0, cells[:, 1] - box.col0]
    known = np.isfinite(height)
    if not known.all():
        height = np.where(known, height, height[known].mean() if known.any() else 0.0)
    return np.column_stack([grid.centres(cells), height])


def _obstacles(
    holes: Bits,
    ground: Bits,
    height: NDArray[np.float32],
    top: NDArray[np.float32],
    grid: Grid,
    box: Box,
) -> tuple[Obstacle, ...]:
    """Group the measured unsafe cells inside a contour; their height is over the zone around them."""

    def level(place: Box, row: int, col: int) -> float:
        edges = place.row0 - AROUND, place.row1 + AROUND, place.col0 - AROUND, place.col1 + AROUND
        return middle_height(ground, height, *edges)

    def tops(cells: NDArray[np.int32]) -> NDArray[np.float32]:
        highest, mean = top[cells[:, 0], cells[:, 1]], height[cells[:, 0], cells[:, 1]]
        return np.where(np.isnan(highest), mean, highest)

    return grouped(holes, tops, level, grid, box, MOST_OBSTACLES)
