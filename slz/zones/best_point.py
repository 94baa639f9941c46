"""Best point of a zone: the one with the greatest clearance."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Box
from slz.kernels.raster.distance_transform import most_certain
from slz.kernels.raster.zone_views import sure_clearance
from slz.landing_point.helicopter_areas import helicopter_areas
from slz.landing_point.surroundings import ground_m, horizon_towards
from slz.terrain.footing import ALL_HEADINGS, ANY_FOOTING, Footing, judges_headings
from slz.terrain.terrain_view import TerrainView
from slz.zone import LandingPoint
from slz.zones.detection import Candidate, side_in_cells
from slz.zones.tile_view import TileView

OTHERS = 6  # cells tried where the first excludes a heading
# Certainty of ground whose slope and relief are far from their limits, and of less and less sure ground.
LEAST_CERTAINTIES = np.array([0.99, 0.98, 0.96, 0.92, 0.84], np.float32)


def best_point(
    candidate: Candidate,
    farthest: NDArray[np.int64],
    terrain: TerrainView,
    view: TileView | None,
    sensor_enu_m: NDArray[np.float64],
    parameters: Parameters,
) -> LandingPoint:
    """Return the point of a zone with the greatest clearance.

    Ground that is safe with little to spare may be refused when it is seen from nearer. So the point is amid
    undoubted ground, as wide as the square that a zone must hold; where the zone has none, amid the surest
    that it has. Where none of the cells of greatest clearance is, those farthest from any less sure ground
    are taken.

    Among points whose clearance differs by less than half a cell, the most certain wins, then the least
    steep, then the nearest to the vehicle. Where some headings are excluded there, because something is near,
    the one of most headings among it and up to `OTHERS` more is taken. Its certainty is that of a point that
    may be missed by the touchdown error, as of a selected point.

    Parameters
    ----------
    farthest
        `greatest_clearance` of the zone's own cells.
    view
        Of a map in tiles.
    """
    p, grid, wide, (east_m, north_m) = (
        parameters,
        terrain.grid,
        candidate.words_box,
        sensor_enu_m[:2].tolist(),
    )
    place, error_m = (grid.west_m, grid.south_m, grid.cell_m), parameters.touchdown_error_m
    maps = view or TileView.copied(
        terrain.layer, wide, math.ceil(error_m / grid.cell_m), "slope_deg", "certainty", "height_m"
    )
    cells, distance2, (slope_deg, certainty, least_certainty, height_m) = sure_clearance(
        *maps[:5], wide.row0, wide.col0, candidate.own_bits, farthest, candidate.square_side,
        side_in_cells(p.min_square_m, grid), LEAST_CERTAINTIES, place, error_m,
    )  # fmt: skip

    def footing_of(index: int) -> Footing:
        if not judges_headings(p):  # as on the far map
            return ANY_FOOTING
        return terrain.footing_at(np.array([*grid.centre(*cells[index].tolist()), 0.0]), error_m)

    first = best = most_certain(cells, certainty, slope_deg, *place, east_m, north_m)
    footing = footing_of(first)
    for other in () if footing.headings_deg == ALL_HEADINGS else _others(certainty, first):
        found = footing_of(other)
        if len(found.headings_deg) > len(footing.headings_deg):
            best, footing = other, found
        if footing.headings_deg == ALL_HEADINGS:
            break
    row, col = cells[best].tolist()
    centre, up_m = grid.centre(row, col), float(height_m[best] + np.float32(maps.datum_m))
    enu_m = np.array(
        [*centre, ground_m(terrain, Box(row, row + 1, col, col + 1)) if math.isnan(up_m) else up_m]
    )
    return LandingPoint(
        enu_m=enu_m,
        clearance_m=(math.sqrt(distance2[best]) - 0.5) * grid.cell_m,
        square_side_m=candidate.square_side * grid.cell_m,
        slope_deg=float(slope_deg[best]),
        certainty=float(least_certainty[best]),
        horizon_deg=horizon_towards(enu_m, sensor_enu_m, terrain, p),
        distance_m=math.hypot(centre[0] - east_m, centre[1] - north_m),
        surface=terrain.surface_at(enu_m, p.footprint_m / 2),
        headings_deg=footing.headings_deg if footing.is_judged else None,
        blocked_by=footing.blocked_by,
        areas=helicopter_areas(enu_m, terrain, p),
    )


def _others(certainty: NDArray[np.float32], first: int) -> list[int]:
    """Return the indices of other cells, spread evenly over all, the most certain first."""
    spread = np.unique(np.linspace(0, len(certainty) - 1, OTHERS).astype(np.intp))
    order = spread[np.argsort(-certainty[spread], kind="stable")]
    return [index for index in order.tolist() if index != first]
