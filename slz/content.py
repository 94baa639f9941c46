"""Parameters of a zone: counts, certainty, roughness, obstacles, room to land (SLZ paper §3.4.1)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.boundary import without_collinear
from slz.grid import Box
from slz.kernels.bits import Bits
from slz.kernels.groups import middle_height
from slz.kernels.tally import tally
from slz.landing_point import Readable, best_point
from slz.lazy import Later
from slz.maps import SAFE, UNSAFE
from slz.search import Candidate
from slz.surroundings import Obstacle, grouped
from slz.zone import Zone

MOST_OBSTACLES = 200
AROUND = 3  # cells, of the ground that an obstacle's height is over
STRIP = 64  # rows, whose maps are in the cache while they are added up


def describe(
    candidate: Candidate,
    terrain: Readable,
    sensor_enu_m: NDArray[np.float64],
    parameters: Parameters,
    zone_id: int,
) -> Zone:
    """Work out everything that is reported of a candidate.

    The zone is its safe cells; counts, certainty and obstacles are of the cells inside the contour.
    """
    grid = terrain.grid
    counts, sums, holes = _tallied(candidate, terrain)
    n_own, n_all, n_safe, n_unsafe = counts.tolist()
    sure, slopes, n_slopes, roughs, n_roughs = sums.sum(axis=1).tolist()
    return Zone(
        id=zone_id,
        box=candidate.box,
        cells=Later(lambda: candidate.component),
        area_m2=n_own * grid.cell_m**2,
        certainty=sure / n_all,
        n_safe=n_safe,
        n_unsafe=n_unsafe,
        n_uncertain=n_all - n_safe - n_unsafe,
        slope_deg=slopes / n_slopes if n_slopes else math.nan,
        roughness=roughs / n_roughs if n_roughs else math.nan,
        boundary_cells=candidate.boundary_cells,
        corners_enu_m=_with_heights(without_collinear(candidate.boundary_cells), terrain),
        obstacles=_obstacles(holes, candidate.own_bits, candidate.words_box, terrain),
        best=best_point(candidate, terrain, sensor_enu_m, parameters),
    )


def _tallied(candidate: Candidate, terrain: Readable) -> tuple[NDArray[np.int64], NDArray[np.float64], Bits]:
    """Return counts, sums and unsafe cells of a candidate, see `tally`."""
    content, wide = candidate.content_bits, candidate.words_box
    counts, sums, holes = np.zeros(4, np.int64), np.zeros((5, 64)), np.zeros_like(content)
    for row in range(0, len(content), STRIP):
        rows = slice(row, min(row + STRIP, len(content)))
        held = np.flatnonzero(content[rows].any(axis=0))
        words = slice(int(held[0]), int(held[-1]) + 1)
        west, south = wide.col0 + 64 * words.start, wide.row0 + row
        box = Box(south, wide.row0 + rows.stop, west, wide.col0 + 64 * words.stop)
        certainty, slope = terrain.layer("certainty", box), terrain.layer("slope_deg", box)
        tally(
            candidate.own_bits[rows, words], content[rows, words], terrain.state(box), SAFE, UNSAFE,
            certainty, slope, terrain.layer("roughness", box), counts, sums, holes[rows, words],
        )  # fmt: skip
    return counts, sums, holes


def _with_heights(cells: NDArray[np.int32], terrain: Readable) -> NDArray[np.float64]:
    """Return (n, 3) centres of cells; where no return lies the mean of the others' heights stands in."""
    height = terrain.layer_at("height_m", cells)
    known = np.isfinite(height)
    if not known.all():
        height = np.where(known, height, height[known].mean() if known.any() else 0.0)
    return np.column_stack([terrain.grid.centres(cells), height])


def _obstacles(holes: Bits, own: Bits, box: Box, terrain: Readable) -> tuple[Obstacle, ...]:
    """Group the measured unsafe cells inside a contour; their height is over the zone around them."""
    corner = np.array([box.row0, box.col0], np.int32)

    def level(place: Box, row: int, col: int) -> float:
        row0, col0 = place.row0 - AROUND, place.col0 - AROUND
        rows, cols = place.row1 + AROUND - row0, place.col1 + AROUND - col0
        south, west = box.row0 + row0, box.col0 + col0
        around = Box(south, south + rows, west, west + cols)
        return middle_height(own, terrain.layer("height_m", around), row0, col0)

    def tops(cells: NDArray[np.int32]) -> NDArray[np.float32]:
        there = cells + corner
        highest = terrain.layer_at("top_m", there)
        unknown = np.isnan(highest)
        if unknown.any():
            highest[unknown] = terrain.layer_at("height_m", there[unknown])
        return highest

    return grouped(holes, tops, level, terrain.grid, box, MOST_OBSTACLES)
