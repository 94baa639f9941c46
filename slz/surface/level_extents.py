"""Extents of one level with banks: still water is level to centimetres; a river falls evenly.

Water in airborne LiDAR by geometry alone, without a trained classifier: arXiv 2301.06567. Tarmac and pitches
drain by 0.5 to 2 %, so their level changes within metres, and they go on without a bank.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slz.kernels.surface.masks import closed
from slz.kernels.surface.shores import grow
from slz.surface.banks import banks
from slz.surface.even_falls import even_falls
from slz.surface.surface_cells import PLANE_RADIUS, Floats, SurfaceCells, averages

GRADIENT, RESIDUAL_M = 0.01, 0.06  # of a plane over five cells: level as water, even with ripples
ROUGHEST_M, SIGMAS = 0.2, 2.5  # of planes over ten cells, with waves; how far a shore cell may be off
SMALLEST_M2 = 40.0  # extent of level planes, that is without a margin of two cells
BAND_M = 0.06  # a cell at the shore belongs to the water if its mean is so near the level
EXACT_M, POOR_M, POOR_FALL_M = 0.006, 0.03, 0.012  # standard deviation of water; of ground; about a fall
FALLING_M = 0.018  # standard deviation of a level from which the extent may fall

EXTENTS_M2 = 40.0, 100.0, 400.0, 10_000.0, 40_000.0  # nothing but water is level over so much
SCORE_EXTENTS = -2.0, 0.0, 1.5, 1.5, 3.0  # log odds
SCORE_FALLING = 1.5  # at most, of an extent that falls
FALLS, SCORES_FALL = (0.003, 0.006), (0.0, -3.0)
SCORE_POOR = 1.5


@dataclass(frozen=True, slots=True)
class LevelExtents:
    """Extents of one level, or of one even fall.

    labels: (rows, cols) int32, 0 for none. level_m: (rows, cols) of the water there, if it is water; NaN for
    none. Of each label: log_odds, what the extent says for water; residual_m of its planes, root mean square.
    """

    labels: NDArray[np.int32]
    level_m: Floats
    log_odds: NDArray[np.float64]
    residual_m: NDArray[np.float64]

    def evidence(self) -> Floats:
        """Return the log odds for water of every cell, 0 where no extent is."""
        return np.asarray(self.log_odds[self.labels], np.float32)


def level_extents(cells: SurfaceCells) -> LevelExtents:
    """Find the extents of one level, and how much they are like water.

    Planes through cells twice as wide find rippled or sparsely hit water, and say more where they find it.
    """
    fine, coarse = fine_extents(cells), _extents(cells.coarser(), ROUGHEST_M, np.inf)
    if not coarse.log_odds.any():
        return fine
    rows, cols = cells.shape
    wide = coarse.labels.repeat(2, axis=0).repeat(2, axis=1)[:rows, :cols]
    level_m = coarse.level_m.repeat(2, axis=0).repeat(2, axis=1)[:rows, :cols]
    band_m = np.maximum(BAND_M, SIGMAS * coarse.residual_m)[wide]
    with np.errstate(invalid="ignore"):
        belongs = ~cells.seen | (np.abs(cells.mean_m - level_m) < band_m)
    wide = np.where(belongs, wide, 0)
    better = (wide > 0) & ((fine.labels == 0) | (coarse.log_odds[wide] > fine.log_odds[fine.labels]))
    return LevelExtents(
        np.where(better, wide + len(fine.log_odds) - 1, fine.labels),
        np.where(better, level_m, fine.level_m),
        np.concatenate([fine.log_odds, coarse.log_odds[1:]]),
        np.concatenate([fine.residual_m, coarse.residual_m[1:]]),
    )


def fine_extents(cells: SurfaceCells) -> LevelExtents:
    """Find the extents of one level in cells of the given size."""
    return _extents(cells, RESIDUAL_M, FALLING_M)


def _extents(cells: SurfaceCells, most_residual_m: float, falling_m: float) -> LevelExtents:
    """Find the extents of one level in cells of one size; those less exact than `falling_m` may fall."""
    labels, n = _cores(cells, most_residual_m)
    level_m = np.full(cells.shape, np.nan, np.float32)
    if n == 1:
        return LevelExtents(labels, level_m, np.zeros(1), np.zeros(1))
    within, size = labels > 0, np.bincount(labels.ravel(), minlength=n)
    own, height = labels[within], cells.level_m[within].astype(np.float64)
    residual2 = cells.residual_m[within].astype(np.float64) ** 2
    level, noise_m2 = averages(own, height, n), averages(own, residual2 / cells.n_around[within], n)
    inexact_m = np.sqrt(np.maximum(0, averages(own, (height - level[own]) ** 2, n) - noise_m2))
    exact = np.interp(inexact_m, [EXACT_M, POOR_M], [1.0, -1.0])
    area = np.interp(np.log(np.maximum(size, 1) * cells.cell_m**2), np.log(EXTENTS_M2), SCORE_EXTENTS)
    score, level_m[within] = np.zeros(n), level[own]
    falling = inexact_m > falling_m
    if falling.any():
        falls = even_falls(labels, height, noise_m2, cells.cell_m)
        falling &= falls.gradient < FALLS[-1]
        exact = np.where(falling, np.interp(falls.inexact_m, [EXACT_M, POOR_FALL_M], [1.0, -1.0]), exact)
        area = np.where(falling, np.minimum(area, SCORE_FALLING), area)
        score += np.where(falling, np.interp(falls.gradient, FALLS, SCORES_FALL), 0)
        level_m[within] = np.where(falling[own], falls.level_m, level[own])
    score += np.minimum(area, 0) + np.maximum(area, 0) * exact - SCORE_POOR * np.maximum(-exact, 0)
    residual_m = np.sqrt(averages(own, residual2, n))
    labels, level_m = _with_shore(cells, labels, level_m, np.maximum(BAND_M, SIGMAS * residual_m))
    around = banks(cells, labels, level_m, falling)
    score += np.where(falling & (around > 0), around * np.maximum(exact, 0), around)
    score[0] = 0
    return LevelExtents(labels, level_m, score, residual_m)


def _cores(cells: SurfaceCells, most_residual_m: float) -> tuple[NDArray[np.int32], int]:
    """Return the labels of connected level planes, large enough for an extent, and how many with label 0."""
    with np.errstate(invalid="ignore"):
        core = (cells.gradient < GRADIENT) & (cells.residual_m < most_residual_m)
    labels, n = ndimage.label(core)
    wide = np.bincount(labels.ravel(), minlength=n + 1) * cells.cell_m**2 >= SMALLEST_M2
    wide[0] = False
    number = np.zeros(len(wide), np.int32)
    number[wide] = np.arange(1, np.count_nonzero(wide) + 1)
    return number[labels], int(np.count_nonzero(wide)) + 1


def _with_shore(
    cells: SurfaceCells, labels: NDArray[np.int32], level_m: Floats, band_m: NDArray[np.float64]
) -> tuple[NDArray[np.int32], Floats]:
    """Return extents grown over the margin that the planes leave, up to cells that rise from their level."""
    seen, mean = cells.seen, np.ascontiguousarray(cells.mean_m)
    for _ in range(PLANE_RADIUS + 1):
        labels, level_m = grow(labels, level_m, seen, mean, band_m)
    if not seen.all():
        labels = np.where(
            seen | closed((labels > 0) & seen), labels, 0
        )  # gaps within belong to it, no others
    return labels, np.where(labels > 0, level_m, np.float32(np.nan))
