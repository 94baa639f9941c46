"""Zonal statistics, cached per tile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box
from slz.kernels.cells.cell_record import TILE
from slz.kernels.footprint.classify import A_CERTAINTY, A_ROUGHNESS, A_SLOPE
from slz.kernels.raster.bitmap import Bits
from slz.kernels.raster.zonal_sums import ZONAL_STATISTICS, carry_over, zonal_sums, zonal_sums_of_tiles
from slz.terrain.terrain import EvidenceTerrain
from slz.terrain.terrain_maps import SAFE, UNSAFE
from slz.terrain.terrain_view import CellView
from slz.zones.detection import Candidate

STRIP = 64  # rows summed at a time, so that their maps stay in the cache
PLACES = A_CERTAINTY, A_SLOPE, A_ROUGHNESS


@dataclass(frozen=True, slots=True, eq=False)
class ZonalStatistics:
    """Zonal statistics of a zone.

    totals: statistics as in `zonal_sums`, the sums of `parts`, (rows, columns, statistics). holes: unsafe
    cells inside the contour. versions: of the tiles, (rows, columns). unchanged: whether no tile changed.
    """

    totals: NDArray[np.float64]
    holes: Bits
    parts: NDArray[np.float64]
    versions: NDArray[np.int64]
    unchanged: bool = False


def zonal_statistics_of(
    candidate: Candidate,
    terrain: CellView,
    old: Candidate | None = None,
    known: ZonalStatistics | None = None,
) -> ZonalStatistics:
    """Return the zonal statistics of a candidate; those of unchanged tiles come from an older candidate.

    Sums are taken per tile first, then over all tiles, so they do not depend on what was cached.
    """
    if isinstance(terrain, EvidenceTerrain):
        return _by_tiles(candidate, terrain, old, known)
    content, wide = candidate.content_bits, candidate.words_box
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
            candidate.own_bits[rows, words], content[rows, words], terrain.state(box), SAFE, UNSAFE,
            certainty, slope, terrain.layer("roughness", box), parts[part, 0], holes[rows, words],
        )  # fmt: skip
    return ZonalStatistics(_total(parts), holes, parts, np.empty((0, 0), np.int64))


def _by_tiles(
    candidate: Candidate, terrain: EvidenceTerrain, old: Candidate | None, known: ZonalStatistics | None
) -> ZonalStatistics:
    own, content, wide = candidate.own_bits, candidate.content_bits, candidate.words_box
    there, table, versions, pools = terrain.tiles_within(wide)
    if there.col0 % TILE:
        raise ValueError("the words of a candidate must be rows of the terrain's tiles: see `safe_bits`")
    holes, parts = np.zeros_like(content), np.zeros((*table.shape, ZONAL_STATISTICS))
    wanted, unchanged = np.ones(table.shape, bool), False
    if old is not None and known is not None:
        down, right = wide.row0 - old.words_box.row0, (wide.col0 - old.words_box.col0) // 64
        unchanged = carry_over(
            there.row0, versions, own, content, down, right,
            known.versions, old.own_bits, old.content_bits, known.parts, known.holes, wanted, parts, holes,
        )  # fmt: skip
    zonal_sums_of_tiles(
        pools.layers, pools.states, table, wanted, there.row0, *PLACES, SAFE, UNSAFE,
        own, content, parts, holes,
    )  # fmt: skip
    return ZonalStatistics(_total(parts), holes, parts, versions, unchanged)


def _total(parts: NDArray[np.float64]) -> NDArray[np.float64]:
    total: NDArray[np.float64] = parts.reshape(-1, ZONAL_STATISTICS).sum(axis=0)
    return total
