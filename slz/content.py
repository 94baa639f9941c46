"""Parameters of a zone: counts, certainty, roughness, obstacles, room to land (SLZ paper §3.4.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.boundary import without_collinear
from slz.grid import Box
from slz.kernels.bits import packed
from slz.kernels.groups import middle_height
from slz.landing_point import Terrain, best_point
from slz.maps import SAFE, UNKNOWN, UNSAFE
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
    state = terrain.state(box)
    content = candidate.content == 1
    n_total = int(content.sum())
    n_safe = int((content & (state == SAFE)).sum())
    n_uncertain = int((content & (state == UNKNOWN)).sum())
    certainty = float(terrain.layer("certainty", box)[content].mean())
    cells = candidate.component
    own = candidate.component == 1
    corners = without_collinear(candidate.boundary_cells)
    return Zone(
        id=zone_id,
        box=box,
        cells=cells,
        area_m2=float(cells.sum()) * grid.cell_m**2,
        certainty=certainty,
        n_safe=n_safe,
        n_unsafe=n_total - n_safe - n_uncertain,
        n_uncertain=n_uncertain,
        slope_deg=_mean(terrain.layer("slope_deg", box)[own]),
        roughness=_mean(terrain.layer("roughness", box)[own]),
        boundary_cells=candidate.boundary_cells,
        corners_enu_m=_with_heights(corners, terrain),
        obstacles=_obstacles(content & (state == UNSAFE), own, terrain, box),
        best=best_point(candidate, terrain, sensor_enu_m, parameters),
    )


def _mean(values: NDArray[np.float32]) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else float("nan")


def _with_heights(cells: NDArray[np.int32], terrain: Terrain) -> NDArray[np.float64]:
    low, high = cells.min(axis=0), cells.max(axis=0) + 1
    box = Box(int(low[0]), int(high[0]), int(low[1]), int(high[1]))
    height = terrain.layer("height_m", box)[cells[:, 0] - box.row0, cells[:, 1] - box.col0]
    if np.isnan(height).any():  # safe cells between returns: the zone's own level stands in
        height = np.where(np.isnan(height), _mean(height) if np.isfinite(height).any() else 0.0, height)
    return np.column_stack([terrain.grid.centres(cells), height])


def _obstacles(
    holes: NDArray[np.bool_], own: NDArray[np.bool_], terrain: Terrain, box: Box
) -> tuple[Obstacle, ...]:
    """Group the measured unsafe cells inside a contour; their height is over the zone around them."""
    height, top = terrain.layer("height_m", box), terrain.layer("top_m", box)
    top = np.where(np.isnan(top), height, top)
    ground = packed((own & np.isfinite(height)).view(np.uint8))

    def level(place: Box, row: int, col: int) -> float:
        edges = place.row0 - AROUND, place.row1 + AROUND, place.col0 - AROUND, place.col1 + AROUND
        return middle_height(ground, height, *edges)

    return grouped(holes, top, level, terrain.grid, box, MOST_OBSTACLES)
