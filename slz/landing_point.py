"""Where in a zone to land, and whether a selected landing point (SLP) is still safe (SLZ thesis §4.3.2)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, special

from params import Parameters
from slz.evidence import EvidenceTerrain
from slz.grid import Box
from slz.search import Candidate
from slz.source_terrain import SourceTerrain
from slz.zone import LandingPoint

Terrain = EvidenceTerrain | SourceTerrain


class PointState(Enum):
    """What is known of a selected point."""

    SAFE = "safe"
    UNSAFE = "unsafe"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class SelectedPoint:
    """State of the selected landing point after a window.

    in_map is False when the vehicle's map has left the point behind; the state is then the last one known
    (SLZ thesis §4.3.2.2). height_m is the ground's height at the point, NaN where unknown.
    """

    enu_m: NDArray[np.float64]
    state: PointState
    in_map: bool
    height_m: float
    slope_deg: float
    relief_m: float
    zone_id: int | None


def best_point(candidate: Candidate, terrain: Terrain, parameters: Parameters) -> LandingPoint:
    """Return the point of a zone farthest from everything that is not the zone; of equals the least steep."""
    grid, box = terrain.grid, candidate.box
    padded = np.pad(candidate.component, 1)
    distance = ndimage.distance_transform_edt(padded)[1:-1, 1:-1]
    slope = terrain.layer("slope_deg", box)
    widest = float(distance.max())
    score = np.where(distance >= widest - 0.5, -np.nan_to_num(slope, nan=90.0), -np.inf)
    row, col = np.unravel_index(int(np.argmax(score)), score.shape)
    east, north = grid.centre(int(row) + box.row0, int(col) + box.col0)
    cell = Box(int(row) + box.row0, int(row) + box.row0 + 1, int(col) + box.col0, int(col) + box.col0 + 1)
    return LandingPoint(
        enu_m=np.array([east, north, ground_m(terrain, cell)]),
        clearance_m=(float(distance[row, col]) - 0.5) * grid.cell_m,
        square_side_m=candidate.square_side * grid.cell_m,
        slope_deg=float(slope[row, col]),
        certainty=certainty_at(terrain, cell, parameters),
    )


def certainty_at(terrain: Terrain, cell: Box, parameters: Parameters) -> float:
    """Return the probability that slope and relief of the footprint at a cell are within their limits.

    Both are taken as normally distributed: the slope about the fitted one with its standard error, the
    relief with the noise of the two returns that span it. In source mode the sources know no such thing
    and the cell's own safety is returned.
    """
    if isinstance(terrain, SourceTerrain):
        return float(terrain.safe[cell.row0, cell.col0])
    slope, sigma, relief = (
        float(terrain.layer(name, cell)[0, 0]) for name in ("slope_deg", "slope_sigma_deg", "relief_m")
    )
    if not np.isfinite([slope, sigma, relief]).all():
        return 0.0
    spread_m = max(parameters.range_noise_m, 1e-3) * np.sqrt(2)
    within_slope = special.ndtr((parameters.safe_slope_deg - slope) / max(sigma, 1e-3))
    within_relief = special.ndtr((parameters.relief_m - relief) / spread_m)
    return float(within_slope * within_relief)


def ground_m(terrain: Terrain, cell: Box) -> float:
    """Return the height of the ground at a cell, from its neighbours where it holds no return itself."""
    for radius in range(4):
        heights = terrain.layer("height_m", cell.grown(radius, terrain.grid))
        if np.isfinite(heights).any():
            return float(np.nanmedian(heights))
    return float("nan")


def judge(
    enu_m: NDArray[np.float64], terrain: Terrain, parameters: Parameters, before: SelectedPoint | None
) -> SelectedPoint:
    """Judge a selected point anew: it is safe only when every cell within the touchdown error is safe.

    A point that the map has left behind keeps its last state; one never mapped is unknown.
    """
    grid = terrain.grid
    row, col = grid.index(float(enu_m[0]), float(enu_m[1]))
    if not grid.holds(row, col):
        kept = before.state if before is not None else PointState.UNKNOWN
        nan = float("nan")
        height = before.height_m if before is not None else nan
        return SelectedPoint(enu_m, kept, False, height, nan, nan, None)
    reach = 0
    if isinstance(terrain, EvidenceTerrain):
        reach = round(parameters.touchdown_error_m / grid.cell_m)
    cell = Box(row, row + 1, col, col + 1)
    state = terrain.state(cell.grown(reach, grid))
    verdict = PointState.UNKNOWN
    if (state == 1).all():
        verdict = PointState.SAFE
    elif (state == 0).any():
        verdict = PointState.UNSAFE
    return SelectedPoint(
        enu_m=enu_m,
        state=verdict,
        in_map=True,
        height_m=ground_m(terrain, cell),
        slope_deg=float(terrain.layer("slope_deg", cell)[0, 0]),
        relief_m=float(terrain.layer("relief_m", cell)[0, 0]),
        zone_id=None,
    )
