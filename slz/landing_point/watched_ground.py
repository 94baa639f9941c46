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

Heights = NDArray[np.float32]
AROUND_M = 4.0  # width of the ground beyond what is watched, from which a shift of all heights is estimated


@dataclass(frozen=True, slots=True, eq=False)
class HeightPatch:
    """Read-only square cells around a place; row 0 is the southernmost.

    top_m: (rows, cols) float32, highest of what stands in the cell and those around, or of the ground, up in
    the map frame; NaN where unknown. even: (rows, cols), known cells among which nothing stands.
    """

    west_m: float
    south_m: float
    cell_m: float
    top_m: Heights
    even: NDArray[np.bool_]


def highest_around(ground_m: Heights, top_m: Heights, relief_m: float) -> tuple[Heights, NDArray[np.bool_]]:
    """Return the highest top of 3 x 3 cells, NaN where unknown, and the known cells that are even.

    An edge is not certain to within a cell. Even are 3 x 3 cells whose ground and tops differ by less than
    `relief_m`.
    """
    known = np.isfinite(ground_m)
    high = ndimage.maximum_filter(np.where(np.isfinite(top_m), top_m, -np.inf), size=3, mode="nearest")
    low = ndimage.minimum_filter(np.where(known, ground_m, np.inf), size=3, mode="nearest")
    tops = np.where(np.isfinite(high), high, np.nan).astype(np.float32)
    return tops, known & (high - low < relief_m)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WatchedGround(HeightPatch):
    """Cells of the near map around a point (3,), in gaps that count as seen with the highest top around.

    footprint_m: distance from the point within which nothing higher than `least_m` may come. radius_m:
    likewise, for what is higher than `disc_least_m`, the underside of rotor and tail. range_noise_m,
    angle_noise_rad: standard deviations of a ray's length and direction.
    """

    enu_m: NDArray[np.float64]
    footprint_m: float
    least_m: float
    radius_m: float
    disc_least_m: float
    range_noise_m: float
    angle_noise_rad: float


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
    highest = np.fmax(*terrain.ground_and_top(box))
    tops, even = highest_around(highest, highest, p.relief_m)
    gap = 2 * math.ceil(p.coverage_m / grid.cell_m) + 1
    over_gap = ndimage.maximum_filter(
        np.where(np.isfinite(highest), highest, -np.inf), size=gap, mode="nearest"
    )
    tops = np.where(np.isfinite(tops) | ~np.isfinite(over_gap), tops, over_gap).astype(np.float32)
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
