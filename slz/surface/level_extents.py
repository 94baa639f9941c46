"""Extents of one level with banks: still water is level to centimetres, and the ground rises around it.

Water in airborne LiDAR by geometry alone, without a trained classifier: arXiv 2301.06567. Tarmac and pitches
drain by 0.5 to 2 %, so their level changes within metres, and they go on without a bank.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slz.kernels.surface.masks import closed, filled
from slz.kernels.surface.shores import around_shore, grow
from slz.surface.surface_cells import PLANE_RADIUS, Floats, SurfaceCells, around, with_margin

GRADIENT, RESIDUAL_M = 0.01, 0.06  # of a plane over five cells: level as water, even with ripples
ROUGHEST_M, SIGMAS = 0.2, 2.5  # of planes over ten cells, with waves; how far a shore cell may be off
SMALLEST_M2 = 40.0  # extent of level planes, that is without a margin of two cells
BAND_M = 0.06  # a cell at the shore belongs to the water if its mean is so near the level
BANK_M = 0.10  # ground higher than the level by this is a bank
WALL_M, WALLED_M2 = 1.0, 400.0  # what rises more around a small extent is a wall or a tree, and tells nothing
BANK_CELLS = 4  # width of the ring in which banks are looked for
FEWEST_RING = 12  # cells of the ring that were seen
SECTORS = 12  # directions in which a bank is looked for
BANKED_M2, BANKED_SIDES = (100.0, 400.0, 1500.0, 4000.0), (7, 6, 3, 1)  # the larger, the fewer need a bank
EXACT_M, POOR_M = 0.006, 0.03  # standard deviation of the level of water, and of ground

EXTENTS_M2 = 40.0, 100.0, 400.0, 10_000.0, 40_000.0  # nothing but water is level over so much
SCORE_EXTENTS = -2.0, 0.0, 1.5, 1.5, 3.0  # log odds
SCORE_POOR = 1.5
SCORE_BANKS = 3.5
SCORE_EVEN = -2.5
SCORE_SPILL = -4.0


@dataclass(frozen=True, slots=True)
class LevelExtents:
    """Extents of one level.

    labels: (rows, cols) int32, 0 for none. Of each label: log_odds, what the extent says for water; level_m;
    residual_m of its planes, root mean square.
    """

    labels: NDArray[np.int32]
    log_odds: NDArray[np.float64]
    level_m: NDArray[np.float64]
    residual_m: NDArray[np.float64]

    def evidence(self) -> Floats:
        """Return the log odds for water of every cell, 0 where no extent is."""
        return np.asarray(self.log_odds[self.labels], np.float32)


def level_extents(cells: SurfaceCells) -> LevelExtents:
    """Find the extents of one level, and how much they are like water.

    Planes through cells twice as wide find rippled or sparsely hit water, and say more where they find it.
    """
    fine, coarse = fine_extents(cells), _extents(cells.coarser(), ROUGHEST_M)
    if not coarse.log_odds.any():
        return fine
    rows, cols = cells.shape
    wide = coarse.labels.repeat(2, axis=0).repeat(2, axis=1)[:rows, :cols]
    band_m = np.maximum(BAND_M, SIGMAS * coarse.residual_m)[wide]
    with np.errstate(invalid="ignore"):
        belongs = ~cells.seen | (np.abs(cells.mean_m - coarse.level_m[wide]) < band_m)
    wide = np.where(belongs, wide, 0)
    better = (wide > 0) & ((fine.labels == 0) | (coarse.log_odds[wide] > fine.log_odds[fine.labels]))
    labels = np.where(better, wide + len(fine.log_odds) - 1, fine.labels)
    return LevelExtents(
        labels,
        np.concatenate([fine.log_odds, coarse.log_odds[1:]]),
        np.concatenate([fine.level_m, coarse.level_m[1:]]),
        np.concatenate([fine.residual_m, coarse.residual_m[1:]]),
    )


def fine_extents(cells: SurfaceCells) -> LevelExtents:
    """Find the extents of one level in cells of the given size."""
    return _extents(cells, RESIDUAL_M)


def _extents(cells: SurfaceCells, most_residual_m: float) -> LevelExtents:
    """Find the extents of one level in cells of one size."""
    with np.errstate(invalid="ignore"):
        core = (cells.gradient < GRADIENT) & (cells.residual_m < most_residual_m)
    labels, n = ndimage.label(core)
    wide = np.bincount(labels.ravel(), minlength=n + 1) * cells.cell_m**2 >= SMALLEST_M2
    wide[0] = False
    n = int(np.count_nonzero(wide))
    if n == 0:
        return LevelExtents(np.zeros(cells.shape, np.int32), np.zeros(1), np.full(1, np.nan), np.zeros(1))
    number = np.zeros(len(wide), np.int32)
    number[wide] = np.arange(1, n + 1)
    labels = number[labels]
    own = labels[labels > 0] - 1
    size = np.bincount(own)
    height = cells.level_m[labels > 0].astype(np.float64)
    level = np.bincount(own, height) / size
    variance = np.bincount(own, (height - level[own]) ** 2) / size
    residual2 = cells.residual_m[labels > 0].astype(np.float64) ** 2
    of_noise = np.bincount(own, residual2 / cells.n_around[labels > 0]) / size
    inexact_m = np.sqrt(np.maximum(0, variance - of_noise))
    level = _after_none(np.nan, level)
    residual_m = _after_none(0.0, np.sqrt(np.bincount(own, residual2) / size))
    grown = _with_shore(cells, labels, level, np.maximum(BAND_M, SIGMAS * residual_m))
    exact = np.interp(inexact_m, [EXACT_M, POOR_M], [1.0, -1.0])
    area = np.interp(np.log(size * cells.cell_m**2), np.log(EXTENTS_M2), SCORE_EXTENTS)
    own_score = np.minimum(area, 0) + np.maximum(area, 0) * exact - SCORE_POOR * np.maximum(-exact, 0)
    score = _after_none(0.0, own_score)
    score[1:] += _banks(cells, grown, level)[1:]
    return LevelExtents(grown, score, level, residual_m)


def _after_none(none: float, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values of all labels: that of label 0, which is no extent, and those of the others."""
    return np.concatenate([[none], values])


def _with_shore(
    cells: SurfaceCells, labels: NDArray[np.int32], level: NDArray[np.float64], band_m: NDArray[np.float64]
) -> NDArray[np.int32]:
    """Return labels grown over the margin that the planes leave, up to cells that rise from the level."""
    grown, seen, mean = labels, cells.seen, np.ascontiguousarray(cells.mean_m)
    for _ in range(PLANE_RADIUS + 1):
        grown = grow(grown, seen, mean, level, band_m)
    if seen.all():
        return grown
    inside = closed((grown > 0) & seen)
    return np.where(seen | inside, grown, 0)  # gaps within belong to it, those beyond its shore do not


def _banks(cells: SurfaceCells, grown: NDArray[np.int32], level: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the log odds for water from what lies around each extent: banks, even ground, or a drop.

    Banks on one side of a small extent are a wall beside a yard; a lake may be cut by the edge of a survey.
    """
    n = len(level)
    count, sides = np.zeros((n, 3), np.int64), np.zeros(n, np.int64)
    size = np.maximum(np.bincount(grown.ravel(), minlength=n), 1)
    mean = np.ascontiguousarray(cells.mean_m)
    for label, own in with_margin(grown, n, BANK_CELLS):
        whole = filled(grown[own] == label)  # what stands within is no bank of it
        ring = np.ascontiguousarray(around(whole, BANK_CELLS) & ~whole & cells.seen[own])
        most_m = WALL_M if size[label] * cells.cell_m**2 < WALLED_M2 else np.inf
        heights, middle = np.ascontiguousarray(mean[own]), np.argwhere(whole).mean(axis=0)
        place = level[label], middle[0], middle[1]
        sides[label] = around_shore(ring, heights, *place, BANK_M, most_m, SECTORS, count[label])
    total = count.sum(axis=1)
    up, down, even = (count / np.maximum(total, 1)[:, None]).T
    score = SCORE_EVEN * np.clip((even - 0.3) / 0.4, 0, 1) + SCORE_SPILL * np.clip((down - 0.03) / 0.15, 0, 1)
    fewest = np.interp(size * cells.cell_m**2, BANKED_M2, BANKED_SIDES)
    score += SCORE_BANKS * np.clip((up - 0.35) / 0.35, 0, 1) * np.clip((sides - fewest) / 2, 0, 1)
    return np.asarray(np.where(total >= FEWEST_RING, score, 0.0))
