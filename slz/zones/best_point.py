"""Best point of a zone: the one with the greatest clearance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Box
from slz.kernels.raster.bitmap import Bits, packed, unpacked
from slz.kernels.raster.distance_transform import distances2, greatest_clearance, largest_square, most_certain
from slz.kernels.raster.square_erosion import erode_to_side
from slz.landing_point.helicopter_areas import helicopter_areas
from slz.landing_point.surroundings import ground_m, horizon_towards
from slz.terrain.footing import ALL_HEADINGS, ANY_FOOTING, Footing, judges_headings
from slz.terrain.terrain_view import CellView
from slz.zone import LandingPoint
from slz.zones.detection import Candidate

OTHERS = 6  # cells tried where the first excludes a heading
# Certainty of ground whose slope and relief are far from their limits, and of less and less sure ground.
LEAST_CERTAINTIES = 0.99, 0.98, 0.96, 0.92, 0.84


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


def greatest_clearance_of(candidate: Candidate, terrain: CellView, least_side: int) -> GreatestClearance:
    """Return the cells whose clearance is within half a cell of the greatest.

    Ground that is safe with little to spare may be refused when it is seen from nearer. So the point is amid
    undoubted ground, as wide as the square of `least_side` cells that a zone must hold; where the zone has
    none, amid the surest that it has. Where none of the cells of greatest clearance is, those farthest from
    any less sure ground are taken.
    """
    wide, found = candidate.words_box, greatest_clearance(candidate.own_bits, candidate.square_side)
    cells, distance2 = found[:, :2] + np.array([wide.row0, wide.col0]), found[:, 2]
    amid = _amid_sure(candidate, terrain, cells, least_side)
    if amid.any():
        cells, distance2 = cells[amid], distance2[amid]
    else:
        box = candidate.box
        certainties = terrain.layer("certainty", box)
        for least in LEAST_CERTAINTIES:
            sure, corners = _sure(candidate, certainties, box, least, least_side)
            if corners.any():
                found = greatest_clearance(sure, largest_square(corners, least_side))
                cells = found[:, :2] + np.array([box.row0, box.col0])
                distance2 = distances2(
                    candidate.own_bits, cells - (wide.row0, wide.col0), candidate.square_side
                )
                break
    return GreatestClearance(
        cells=cells,
        distance2=distance2,
        slope_deg=np.nan_to_num(terrain.layer_at("slope_deg", cells), nan=90.0),
        certainty=terrain.layer_at("certainty", cells),
    )


def _amid_sure(
    candidate: Candidate, terrain: CellView, cells: NDArray[np.int64], least_side: int
) -> NDArray[np.bool_]:
    """Return which of the cells of greatest clearance are amid a square of undoubted ground."""
    if not len(cells):  # its square is larger than what is left of it
        return np.zeros(0, bool)
    first, box = cells - (least_side - 1) // 2, candidate.box
    (row0, col0), (row1, col1) = first.min(axis=0).tolist(), (first.max(axis=0) + least_side).tolist()
    around = Box(row0, min(row1, box.row1), col0, min(col1, box.col1))
    _, corners = _sure(
        candidate, terrain.layer("certainty", around), around, LEAST_CERTAINTIES[0], least_side
    )
    rows, cols = (first - (row0, col0)).T
    return np.asarray(unpacked(corners, 0, around.shape[1])[rows, cols] == 1)


def _sure(
    candidate: Candidate, certainties: NDArray[np.float32], box: Box, least: float, least_side: int
) -> tuple[Bits, Bits]:
    """Return the zone's cells of a certainty in a box, and the south-west corners of their squares."""
    own = candidate.component[box.relative_to(candidate.box).slices]
    sure = packed((certainties >= np.float32(least)) & (own == 1))
    corners = sure.copy()
    erode_to_side(corners, 1, least_side)
    return sure, corners


def best_point(
    among: GreatestClearance,
    square_side: int,
    terrain: CellView,
    sensor_enu_m: NDArray[np.float64],
    parameters: Parameters,
) -> LandingPoint:
    """Return the point of a zone with the greatest clearance.

    Among points whose clearance differs by less than half a cell, the most certain wins, then the least
    steep, then the nearest to the vehicle. Where some headings are excluded there, because something is near,
    the one of most headings among it and up to `OTHERS` more is taken. Its certainty is that of a point that
    may be missed by the touchdown error, as of a selected point.

    Parameters
    ----------
    square_side
        Side of the zone's largest square, in cells.
    """
    grid, (east_m, north_m) = terrain.grid, sensor_enu_m[:2].tolist()
    place = grid.west_m, grid.south_m, grid.cell_m
    first = most_certain(among.cells, among.certainty, among.slope_deg, *place, east_m, north_m)
    best, footing = first, _footing_of(among, first, terrain, parameters)
    for other in () if footing.headings_deg == ALL_HEADINGS else _others(among, first):
        found = _footing_of(among, other, terrain, parameters)
        if len(found.headings_deg) > len(footing.headings_deg):
            best, footing = other, found
        if footing.headings_deg == ALL_HEADINGS:
            break
    row, col = among.cells[best].tolist()
    centre = grid.centre(row, col)
    enu_m = np.array([*centre, ground_m(terrain, Box(row, row + 1, col, col + 1))])
    return LandingPoint(
        enu_m=enu_m,
        clearance_m=(math.sqrt(among.distance2[best]) - 0.5) * grid.cell_m,
        square_side_m=square_side * grid.cell_m,
        slope_deg=float(among.slope_deg[best]),
        certainty=terrain.certainty_at(enu_m, parameters.touchdown_error_m),
        horizon_deg=horizon_towards(enu_m, sensor_enu_m, terrain, parameters),
        distance_m=math.hypot(centre[0] - east_m, centre[1] - north_m),
        surface=terrain.surface_at(enu_m, parameters.footprint_m / 2),
        headings_deg=footing.headings_deg if footing.is_judged else None,
        blocked_by=footing.blocked_by,
        areas=helicopter_areas(enu_m, terrain, parameters),
    )


def _footing_of(among: GreatestClearance, index: int, terrain: CellView, parameters: Parameters) -> Footing:
    if not judges_headings(parameters):  # as on the far map
        return ANY_FOOTING
    centre = terrain.grid.centre(*among.cells[index].tolist())
    return terrain.footing_at(np.array([*centre, 0.0]), parameters.touchdown_error_m)


def _others(among: GreatestClearance, first: int) -> list[int]:
    """Return the indices of other cells, spread evenly over all, the most certain first."""
    spread = np.unique(np.linspace(0, len(among.cells) - 1, OTHERS).astype(np.intp))
    order = spread[np.argsort(-among.certainty[spread], kind="stable")]
    return [index for index in order.tolist() if index != first]
