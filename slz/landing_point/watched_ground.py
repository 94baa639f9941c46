"""Ground around the selected point, for a look at every scan between two windows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from params import Parameters
from slz.grid import Box
from slz.terrain.terrain_view import TerrainView

AROUND_M = 4.0  # of ground beyond what is watched, by which a shift of all heights is told


@dataclass(frozen=True, slots=True, eq=False)
class WatchedGround:
    """Read-only heights around a point, of the map's cells; row 0 is the southernmost.

    top_m: (rows, cols) float32, highest of what stands in the cells around and of the ground, up in the map
    frame; NaN where unknown. even: (rows, cols), known cells among which nothing stands. footprint_m:
    distance from the point within which nothing higher than `least_m` may come. radius_m: likewise, for what
    is higher than `disc_least_m`, the underside of rotor and tail. range_noise_m, angle_noise_rad: standard
    deviations of a ray's length and direction.
    """

    enu_m: NDArray[np.float64]
    west_m: float
    south_m: float
    cell_m: float
    top_m: NDArray[np.float32]
    even: NDArray[np.bool_]
    footprint_m: float
    least_m: float
    radius_m: float
    disc_least_m: float
    range_noise_m: float
    angle_noise_rad: float

    def cells_under(self, points_enu_m: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the indices (m,) of the points over this ground, and of their cells in the flat arrays."""
        finite = np.flatnonzero(np.isfinite(points_enu_m).all(axis=1))
        col = np.floor((points_enu_m[finite, 0] - self.west_m) / self.cell_m)
        row = np.floor((points_enu_m[finite, 1] - self.south_m) / self.cell_m)
        rows, cols = self.top_m.shape
        here = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
        return finite[here], (row[here] * cols + col[here]).astype(np.intp)


def watched_ground(enu_m: NDArray[np.float64], terrain: TerrainView, parameters: Parameters) -> WatchedGround:
    """Return the ground of a map around a point (3,)."""
    p, grid = parameters, terrain.grid
    footprint_m = p.footprint_m * math.sqrt(0.5) + p.touchdown_error_m
    rotor_m = p.rotor_diameter_m / 2 + p.rotor_clearance_m if p.rotor_diameter_m else 0.0
    tail_m = p.tail_length_m + p.rotor_clearance_m if p.tail_length_m else 0.0
    heights = ((p.rotor_diameter_m, p.rotor_height_m), (p.tail_length_m, p.tail_height_m))
    lowest_m = min((height for size, height in heights if size), default=math.inf)
    radius_m = max(footprint_m, max(rotor_m, tail_m) + p.touchdown_error_m)
    row, col = grid.index(float(enu_m[0]), float(enu_m[1]))
    reach = math.ceil((radius_m + AROUND_M) / grid.cell_m)
    box = Box(row - reach, row + reach + 1, col - reach, col + reach + 1)
    tops, even = _tops(*terrain.ground_and_top(box), math.ceil(p.coverage_m / grid.cell_m), p.relief_m)
    tops.setflags(write=False)
    even.setflags(write=False)
    return WatchedGround(
        enu_m=enu_m,
        west_m=grid.west_m + box.col0 * grid.cell_m,
        south_m=grid.south_m + box.row0 * grid.cell_m,
        cell_m=grid.cell_m,
        top_m=tops,
        even=even,
        footprint_m=footprint_m,
        least_m=p.relief_m,
        radius_m=radius_m,
        disc_least_m=max(p.relief_m, lowest_m - p.rotor_clearance_m),
        range_noise_m=p.range_noise_m,
        angle_noise_rad=math.radians(p.angle_noise_deg),
    )


def _tops(
    ground: NDArray[np.float32], top: NDArray[np.float32], gap: int, relief_m: float
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return the highest of 3 x 3 cells, in gaps that count as seen of those around; and the even cells.

    gap: width of such gaps, in cells.
    """
    highest = np.fmax(ground, top)
    known = np.isfinite(highest)
    low, high = np.where(known, highest, np.inf), np.where(known, highest, -np.inf)
    around = ndimage.maximum_filter(high, size=3, mode="nearest")
    over_gap = ndimage.maximum_filter(high, size=2 * gap + 1, mode="nearest")
    tops = np.where(np.isfinite(around), around, over_gap)
    even = known & (around - ndimage.minimum_filter(low, size=3, mode="nearest") < relief_m)
    return np.where(np.isfinite(tops), tops, np.nan).astype(np.float32), even
