"""Zone parameters: counts, certainty, roughness, obstacles, landing point (SLZ paper, section 3.4.1)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Box
from slz.kernels.raster.bitmap import Bits
from slz.kernels.raster.connected_components import cells_around, medians
from slz.kernels.raster.zonal_sums import count
from slz.landing_point.obstacles import Groups, grouped
from slz.lazy_fields import Deferred
from slz.terrain.terrain_view import CellView
from slz.zone import Zone
from slz.zones.best_point import GreatestClearance, best_point, greatest_clearance_of
from slz.zones.boundary_points import without_collinear
from slz.zones.detection import Candidate
from slz.zones.zonal_statistics import ZonalStatistics, zonal_statistics_of

MOST_OBSTACLES = 200
AROUND = 3  # cells around an obstacle whose ground its height refers to
BATCH_CELLS = 1 << 16  # cells of such ground read at a time


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """Map contents of a zone, independent of the vehicle, valid while the maps are unchanged.

    All heights are over the terrain's datum, which may drift.
    """

    candidate: Candidate
    statistics: ZonalStatistics
    corners: NDArray[np.int32]
    corners_m: NDArray[np.float32]
    obstacles: Groups
    clearance: GreatestClearance

    @classmethod
    def of(
        cls, candidate: Candidate, terrain: CellView, least_side: int, before: Content | None = None
    ) -> Content:
        """Look a candidate up in the maps, or those of its tiles that changed since before.

        The earlier content must be of the same terrain and grid. least_side: cells of a zone's square.
        """
        if before is None:
            statistics = zonal_statistics_of(candidate, terrain)
        else:
            statistics = zonal_statistics_of(candidate, terrain, before.candidate, before.statistics)
            if statistics.unchanged and candidate.same_as(before.candidate):
                return before
        corners = without_collinear(candidate.boundary_cells)
        return cls(
            candidate=candidate,
            statistics=statistics,
            corners=corners,
            corners_m=terrain.kept_at("height_m", corners),
            obstacles=_obstacles(statistics.holes, candidate.own_bits, candidate.words_box, terrain),
            clearance=greatest_clearance_of(candidate, terrain, least_side),
        )


def describe(
    content: Content,
    terrain: CellView,
    sensor_enu_m: NDArray[np.float64],
    parameters: Parameters,
    zone_id: int,
) -> Zone:
    """Return the description of a zone.

    The zone is its safe cells; counts, certainty and obstacles are of the cells inside the contour.
    """
    grid, candidate, datum_m = terrain.grid, content.candidate, terrain.kept_datum_m
    n_own, n_all = count(candidate.own_bits), count(candidate.content_bits)
    n_safe, n_unsafe, sure, slopes, n_slopes, roughs, n_roughs = content.statistics.totals.tolist()

    def corners() -> NDArray[np.float64]:
        height = content.corners_m + np.float32(datum_m)
        known = np.isfinite(height)
        if not known.all():  # unknown heights get the mean of the known ones
            height = np.where(known, height, height[known].mean() if known.any() else 0.0)
        return np.column_stack([grid.centres(content.corners), height])

    return Zone(
        id=zone_id,
        box=candidate.box,
        cells=Deferred(lambda: candidate.component),
        area_m2=n_own * grid.cell_m**2,
        certainty=sure / n_all,
        n_safe=int(n_safe),
        n_unsafe=int(n_unsafe),
        n_uncertain=n_all - int(n_safe) - int(n_unsafe),
        slope_deg=slopes / n_slopes if n_slopes else math.nan,
        roughness=roughs / n_roughs if n_roughs else math.nan,
        boundary_cells=candidate.boundary_cells,
        corners_enu_m=Deferred(corners),
        obstacles=Deferred(lambda: content.obstacles.over(datum_m)),
        best=best_point(content.clearance, candidate.square_side, terrain, sensor_enu_m, parameters),
    )


def _obstacles(holes: Bits, own: Bits, box: Box, terrain: CellView) -> Groups:
    """Group the measured unsafe cells inside a contour; heights are over the zone around them."""

    def tops(cells: NDArray[np.int32]) -> NDArray[np.float32]:
        highest = terrain.kept_at("top_m", cells)
        unknown = np.flatnonzero(np.isnan(highest))
        if len(unknown):
            highest[unknown] = terrain.kept_at("height_m", cells[unknown])
        return highest

    def grounds(groups: NDArray[np.int64], _: NDArray[np.int32]) -> NDArray[np.float64]:
        found = [np.empty(0)]
        while (done := sum(map(len, found))) < len(groups):
            cells, ends = cells_around(own, groups, done, AROUND, BATCH_CELLS)
            cells[:, 0] += box.row0
            cells[:, 1] += box.col0
            found.append(medians(terrain.kept_at("height_m", cells), ends))
        return np.concatenate(found)

    return grouped(holes, tops, grounds, terrain.grid, box, MOST_OBSTACLES)
