"""Zone parameters: counts, certainty, roughness, obstacles, landing point (SLZ paper, section 3.4.1)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Box, Grid
from slz.kernels.footprint.classify import A_CERTAINTY, A_ROUGHNESS, A_SLOPE
from slz.kernels.raster.bitmap import Bits
from slz.kernels.raster.distance_transform import greatest_clearance
from slz.kernels.raster.zonal_sums import ZONAL_STATISTICS, common, zonal_sums, zonal_sums_of_tiles
from slz.kernels.raster.zone_views import heights_at, zone_obstacles
from slz.landing_point.obstacles import Obstacles
from slz.terrain.terrain_maps import SAFE, UNSAFE
from slz.terrain.terrain_view import TerrainView
from slz.zone import Zone
from slz.zones.best_point import best_point
from slz.zones.detection import Candidate
from slz.zones.polygonise import without_collinear
from slz.zones.tile_view import TileView

STRIP = 64  # rows summed at a time, so that their maps stay in the cache
PLACES = A_CERTAINTY, A_SLOPE, A_ROUGHNESS
NO_TILES, NO_BITS = (np.empty((0, 0), np.int64), np.empty((0, 0), bool)), np.empty((0, 0), np.uint64)
NOTHING_KNOWN = NO_TILES[0], NO_BITS, NO_BITS, np.empty((0, 0, ZONAL_STATISTICS)), NO_BITS
MOST_OBSTACLES = 200
AROUND = 3  # cells around an obstacle whose ground its height refers to
NO_GROUPS, NO_CELLS = (np.empty((0, 6), np.int64), np.empty(0)), np.empty((0, 3), np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class ZonalStatistics:
    """Zonal statistics of a zone.

    totals: statistics as in `zonal_sums`, the sums of `parts`, (rows, columns, statistics). holes: unsafe
    cells inside the contour. versions: of the tiles, (rows, columns). same: tiles in which neither the zone
    nor the map changed. unchanged: whether no tile that the zone touches did.
    """

    totals: NDArray[np.float64]
    holes: Bits
    parts: NDArray[np.float64]
    versions: NDArray[np.int64]
    same: NDArray[np.bool_]
    unchanged: bool = False


def zonal_statistics_of(
    candidate: Candidate,
    terrain: TerrainView,
    view: TileView | None,
    before: tuple[Candidate, ZonalStatistics] | None = None,
) -> ZonalStatistics:
    """Return the zonal statistics of a candidate; those of unchanged tiles come from before.

    Sums are taken per tile first, then over all tiles, so they do not depend on what was cached.
    """
    own, content, wide = candidate.own_bits, candidate.content_bits, candidate.words_box
    if view is not None:
        tiles, down, right, known = view.tiles_under(wide), 0, 0, NOTHING_KNOWN
        if before is not None:
            old, found = before
            down, right = wide.row0 - old.words_box.row0, (wide.col0 - old.words_box.col0) // 64
            known = found.versions, old.own_bits, old.content_bits, found.parts, found.holes
        versions = view.versions[tiles]
        maps = view.layers, view.states, view.table[tiles], versions, PLACES, SAFE, UNSAFE
        total, holes, parts, same, unchanged = zonal_sums_of_tiles(
            *maps, wide.row0 - view.row0, own, content, down, right, *known
        )
        return ZonalStatistics(total, holes, parts, versions, same, unchanged)
    starts, holes = range(0, len(content), STRIP), np.zeros_like(content)
    parts = np.zeros((len(starts), 1, ZONAL_STATISTICS))
    for part, row in enumerate(starts):
        rows = slice(row, min(row + STRIP, len(content)))
        held = np.flatnonzero(content[rows].any(axis=0))
        words = slice(int(held[0]), int(held[-1]) + 1)
        west, south = wide.col0 + 64 * words.start, wide.row0 + row
        box = Box(south, wide.row0 + rows.stop, west, wide.col0 + 64 * words.stop)
        certainty, slope = terrain.layer("certainty", box), terrain.layer("slope_deg", box)
        zonal_sums(
            own[rows, words], content[rows, words], terrain.state(box), SAFE, UNSAFE,
            certainty, slope, terrain.layer("roughness", box), parts[part, 0], holes[rows, words],
        )  # fmt: skip
    return ZonalStatistics(parts.reshape(-1, ZONAL_STATISTICS).sum(axis=0), holes, parts, *NO_TILES)


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """Map contents of a zone, independent of the vehicle, valid while the maps are unchanged.

    All heights are over the terrain's datum, which may drift. cells: of the candidate. corners_enu_m: (m, 3).
    grounds: of the obstacles' groups, as in `zone_obstacles`. farthest: `greatest_clearance` of the zone's
    cells.
    """

    candidate: Candidate
    cells: NDArray[np.uint8]
    statistics: ZonalStatistics
    corners_enu_m: NDArray[np.float64]
    obstacles: Obstacles
    grounds: tuple[NDArray[np.int64], NDArray[np.float64]]
    farthest: NDArray[np.int64]

    @classmethod
    def of(
        cls,
        candidate: Candidate,
        terrain: TerrainView,
        before: Content | None = None,
        view: TileView | None = None,
    ) -> Content:
        """Look a candidate up in the maps, or those of its tiles that changed since before.

        The earlier content must be of the same terrain and grid. view: of a map in tiles.
        """
        wide, own, grid = candidate.words_box, candidate.own_bits, terrain.grid
        known = None if before is None else (before.candidate, before.statistics)
        statistics = zonal_statistics_of(candidate, terrain, view, known)
        if before is not None and candidate.same_as(before.candidate):
            if statistics.unchanged:
                return before
            cells, farthest = before.cells, before.farthest
        else:
            cells, hints = candidate.component, NO_CELLS
            if before is not None:
                old = before.candidate.words_box
                hints = before.farthest[:1] + np.array([old.row0 - wide.row0, old.col0 - wide.col0, 0])
            farthest = greatest_clearance(own, candidate.square_side, hints)
        heights = view or TileView.copied(terrain.layer, wide, 0, "height_m", "top_m")
        obstacles, grounds = obstacles_of(
            heights, wide, own, statistics.holes, grid, statistics.same,
            *(NO_GROUPS if before is None else before.grounds),
        )  # fmt: skip
        corners = without_collinear(candidate.boundary_cells)
        corners_enu_m = np.empty((len(corners), 3))
        corners_enu_m[:, :2], corners_enu_m[:, 2] = grid.centres(corners), heights_at(*heights[:5], corners)
        return cls(
            candidate=candidate,
            cells=cells,
            statistics=statistics,
            corners_enu_m=corners_enu_m,
            obstacles=obstacles,
            grounds=grounds,
            farthest=farthest,
        )


def obstacles_of(
    view: TileView,
    wide: Box,
    own: Bits,
    holes: Bits,
    grid: Grid,
    same: NDArray[np.bool_] = NO_TILES[1],
    old: NDArray[np.int64] = NO_GROUPS[0],
    old_grounds_m: NDArray[np.float64] = NO_GROUPS[1],
) -> tuple[Obstacles, tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """Return a zone's obstacles, and their groups and grounds, see `zone_obstacles`."""
    groups, cells, highest, top_m, grounds_m = zone_obstacles(
        *view[:5], wide.row0, wide.col0, own, holes, MOST_OBSTACLES, AROUND, same, old, old_grounds_m
    )
    over_m = top_m.astype(np.float64) - grounds_m
    return Obstacles(grid, cells, groups[:, 4:], highest, top_m, over_m), (groups, grounds_m)


def describe(
    content: Content,
    terrain: TerrainView,
    sensor_enu_m: NDArray[np.float64],
    parameters: Parameters,
    zone_id: int,
    view: TileView | None = None,
) -> Zone:
    """Return the description of a zone; `view` is that of a map in tiles.

    The zone is its safe cells; counts, certainty and obstacles are of the cells inside the contour.
    """
    grid, candidate, datum_m = terrain.grid, content.candidate, 0.0 if view is None else view.datum_m
    n_own, n_all = (common(bits, bits, 0, 0) for bits in (candidate.own_bits, candidate.content_bits))
    n_safe, n_unsafe, sure, slopes, n_slopes, roughs, n_roughs = content.statistics.totals.tolist()
    corners_enu_m = content.corners_enu_m.copy()
    height = corners_enu_m[:, 2].astype(np.float32) + np.float32(datum_m)
    if not np.isfinite(height.sum()):  # unknown heights get the mean of the known ones
        known = np.isfinite(height)
        height = np.where(known, height, height[known].mean() if known.any() else 0.0)
    corners_enu_m[:, 2] = height
    return Zone(
        id=zone_id,
        box=candidate.box,
        cells=content.cells,
        area_m2=n_own * grid.cell_m**2,
        certainty=sure / n_all,
        n_safe=int(n_safe),
        n_unsafe=int(n_unsafe),
        n_uncertain=n_all - int(n_safe) - int(n_unsafe),
        slope_deg=slopes / n_slopes if n_slopes else math.nan,
        roughness=roughs / n_roughs if n_roughs else math.nan,
        boundary_cells=candidate.boundary_cells,
        corners_enu_m=corners_enu_m,
        obstacles=content.obstacles.over(datum_m),
        best=best_point(candidate, content.farthest, terrain, view, sensor_enu_m, parameters),
    )
