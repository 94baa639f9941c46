"""Zonal statistics, cached per tile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box
from slz.kernels.footprint.classify import A_CERTAINTY, A_ROUGHNESS, A_SLOPE
from slz.kernels.raster.bitmap import Bits
from slz.kernels.raster.zonal_sums import ZONAL_STATISTICS, zonal_sums, zonal_sums_of_tiles
from slz.terrain.terrain_maps import SAFE, UNSAFE
from slz.terrain.terrain_view import TerrainView
from slz.zones.detection import Candidate
from slz.zones.tile_view import TileView

STRIP = 64  # rows summed at a time, so that their maps stay in the cache
PLACES = A_CERTAINTY, A_SLOPE, A_ROUGHNESS
NO_TILES, NO_BITS = (np.empty((0, 0), np.int64), np.empty((0, 0), bool)), np.empty((0, 0), np.uint64)
NOTHING_KNOWN = NO_TILES[0], NO_BITS, NO_BITS, np.empty((0, 0, ZONAL_STATISTICS)), NO_BITS


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
