"""Hazard detection in a DEM: position, extent, height (Flash paper, section 6; SLZ thesis, section 2.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slz.flash.segmentation import segment
from slz.grid import Grid

F64 = NDArray[np.float64]
LEAST_M = 0.25
"""Least height or depth of a hazard: 0.3 m, less what the median filter and the cells remove."""
STANDING_SHARE = 0.5
"""Share of `LEAST_M` by which a segment must stand out to belong to a hazard."""
FIRST_M = 1.6
"""Side of the initial squares of the segmentation."""


@dataclass(frozen=True, slots=True)
class Hazard:
    """Object above the ground, or pit below it.

    east_m, north_m : its centre. extent_m : west, south, east, north edge. height_m : over the ground around,
    negative for a pit. area_m2 : of its cells.
    """

    east_m: float
    north_m: float
    extent_m: tuple[float, float, float, float]
    height_m: float
    area_m2: float


def find_hazards(dem_m: F64, grid: Grid, least_m: float = LEAST_M, xi: float = 2.0) -> tuple[Hazard, ...]:
    """Return the hazards of a DEM, the highest first.

    Parameters
    ----------
    dem_m
        (rows, cols) heights over the ground around, NaN where unknown: such cells are no hazard, and no
        ground either.
    least_m
        Height or depth of the smallest hazard.
    xi
        Tuning parameter of the segmentation.

    A hazard is a group of segments that stand out by half of `least_m`, with at most four cells between them.
    One cell must reach `least_m`, and another one three quarters of it. The height is the median of the cells
    of at least 0.7 times the highest (the second highest of 20 cells or more): a box gets the height of its
    lid.
    """
    if dem_m.shape != (grid.rows, grid.cols):
        raise ValueError(f"hazards: the DEM is {dem_m.shape}, its grid {(grid.rows, grid.cols)}")
    if not least_m > 0:
        raise ValueError(f"hazards: least_m is {least_m}, it must be positive")
    first = 1 << max(1, round(np.log2(FIRST_M / grid.cell_m)))
    mean = segment(dem_m, xi, first).mean_m
    found: list[Hazard] = []
    for sign in (1.0, -1.0):
        with np.errstate(invalid="ignore"):
            out = np.maximum(sign * mean, np.where(sign * dem_m > least_m, sign * dem_m, -np.inf))
            standing = np.nan_to_num(out, nan=-np.inf) > STANDING_SHARE * least_m
        marked, _ = ndimage.label(ndimage.binary_dilation(standing, np.ones((5, 5), bool)), np.ones((3, 3)))
        marked[~standing] = 0
        for k, box in enumerate(ndimage.find_objects(marked), start=1):
            rows, cols = box
            hazard = _hazard(sign * dem_m[box], marked[box] == k, (rows, cols), grid, least_m, sign)
            if hazard is not None:
                found.append(hazard)
    return tuple(sorted(found, key=lambda hazard: -abs(hazard.height_m)))


def _hazard(
    out_m: F64, own: NDArray[np.bool_], box: tuple[slice, slice], grid: Grid, least_m: float, sign: float
) -> Hazard | None:
    """Return one group as a hazard, None where it does not stand out far enough."""
    heights = np.sort(out_m[own & np.isfinite(out_m)])
    if len(heights) < 2 or heights[-1] < least_m or heights[-2] < 0.75 * least_m:
        return None
    top = heights[-1] if len(heights) < 20 else heights[-2]
    row, col = (np.asarray(c) for c in np.nonzero(own & (out_m > STANDING_SHARE * least_m)))
    row, col = row + box[0].start, col + box[1].start
    cell = grid.cell_m
    west, east = grid.west_m + col.min() * cell, grid.west_m + (col.max() + 1) * cell
    south, north = grid.south_m + row.min() * cell, grid.south_m + (row.max() + 1) * cell
    return Hazard(
        east_m=float(grid.west_m + (col.mean() + 0.5) * cell),
        north_m=float(grid.south_m + (row.mean() + 0.5) * cell),
        extent_m=(float(west), float(south), float(east), float(north)),
        height_m=float(sign * np.median(heights[heights >= 0.7 * top])),
        area_m2=float(len(row) * cell**2),
    )
