"""Water surfaces in the returns of LiDARs: dark, specular and vanishing returns."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D, Array3D
from slz.kernels.elementary_functions import F0, F1, interpolate
from slz.kernels.jit import kernel, kernel_for_any_types, kernel_part
from slz.kernels.surface.masks import box_sums
from slz.kernels.surface.surface_record import (
    ASIDE,
    ASIDE_LIGHT,
    ASIDE_M,
    COUNT,
    DARK,
    LOST_OBLIQUE,
    LOST_SLANTED,
    NADIR,
    NADIR_LIGHT,
    NADIR_M,
    OBLIQUE,
    REPORTED,
    SLANTED,
)

FEWEST_DARK = 6.0  # dark returns more than others, of the neighbourhood
AROUND_DARK = 1  # cells
FEWEST_DARK_ON_EXTENT = 60.0  # dark returns around a cell on the same level extent
SCORE_DARK = np.float32(3.5)  # log odds
FEWEST_RETURNS = np.float32(2.0)  # returns of a cell from above, and from aside, whose heights compare
AROUND = 2  # cells
FEWEST_PAIRS = np.float32(6.0)  # of the neighbourhood
BRIGHTER, BRIGHTEST = np.float32(2.0), np.float32(6.0)  # than from aside: dry 1.0 to 1.2, wet tarmac 2 to 5
LEAST_M = np.float32(0.02)  # of the bottom below the surface
ERROR_M = np.float32(3.0 * 0.03)  # three standard errors of a drop, of one pair of returns
LEAST_LIGHT = np.float32(1e-6)
SCORE_SPECULAR = np.float32(4.5)  # log odds
FEWEST_RAYS = np.float32(4.0)  # of a cell that decide
FEWEST_REPORTED = np.float32(3.0)  # lost rays that are no chance
FEWEST_AROUND = np.float32(8.0)  # rays of the neighbourhood
SCORE_ABOVE = np.float32(4.0)  # of a level cell seen from above alone, where no lost ray is reported
EXTENT, FEWEST_ON_EXTENT = 10, np.float32(40.0)  # cells around, and rays there on the same level extent
# Shares of rays answered, and log odds. Water in wind answers slanted rays, so that they never make it dry.
BY_OBLIQUE = (0.1, 0.2, 0.75, 1.0), (4.5, 2.5, -3.0, -6.0)
BY_SLANTED = (0.3, 0.6, 0.85, 0.95), (4.0, 3.0, 0.5, 0.0)


@kernel
def dark_returns(fields: Array3D[np.float32], level: Array2D[np.bool_]) -> Array2D[np.float32]:
    """Return the log odds for water of every cell from how dark it is; 0 where it is not.

    A cell seen from above alone shows a mirror, and is as dark as the level extent around it.

    Parameters
    ----------
    level
        (rows, cols), cells of level extents.
    """
    dark, on_level = fields[DARK : DARK + 1], np.zeros_like(fields[:1])
    out: Array2D[np.float32] = np.zeros_like(fields[0])
    any_dark = any_silent = False
    for k in range(out.size):
        any_dark |= bool(dark.flat[k] > F0)
    if not any_dark:
        return out
    for k in range(out.size):
        if level.flat[k]:
            on_level.flat[k] = dark.flat[k]
            any_silent |= dark.flat[k] == F0
    around = box_sums(dark, AROUND_DARK)
    wide = box_sums(on_level, EXTENT) if any_silent else on_level
    for k in range(out.size):
        by_extent = any_silent and level.flat[k] and wide.flat[k] >= FEWEST_DARK_ON_EXTENT
        if dark.flat[k] >= F0 and (around.flat[k] >= FEWEST_DARK or by_extent):
            out.flat[k] = SCORE_DARK
    return out


@kernel
def specular_returns(fields: Array3D[np.float32]) -> tuple[Array2D[np.float32], Array2D[np.float32]]:
    """Return the log odds for water, and the height of the water over a bottom that was seen, else NaN.

    Both (rows, cols), from what was seen of a cell and its neighbours from above and from aside. The
    neighbours make up for few returns; each cell must shine by itself.
    """
    f, layers = fields.reshape(len(fields), -1), np.zeros_like(fields[:6])
    score, surface_m = np.zeros_like(fields[0]), np.full_like(fields[0], np.nan)
    flat, any_both = layers.reshape(6, -1), False
    for k in range(f.shape[1]):
        above, aside = f[NADIR, k], f[ASIDE, k]
        if above >= FEWEST_RETURNS and aside >= FEWEST_RETURNS:
            pairs, any_both = above * aside / max(above + aside, F1), True
            flat[0, k], flat[1, k] = pairs, pairs * (f[NADIR_M, k] - f[ASIDE_M, k])
            flat[2, k], flat[3, k] = above, above * f[NADIR_LIGHT, k]
            flat[4, k], flat[5, k] = aside, aside * f[ASIDE_LIGHT, k]
    if not any_both:
        return score, surface_m
    sums = box_sums(layers, AROUND).reshape(6, -1)
    for k in range(f.shape[1]):
        n, dim = max(sums[0, k], F1), sums[5, k] / max(sums[4, k], F1)
        if flat[2, k] < FEWEST_RETURNS or n < FEWEST_PAIRS or f[NADIR_LIGHT, k] < BRIGHTER * dim:
            continue
        ratio = sums[3, k] / max(sums[2, k] * dim, LEAST_LIGHT)
        if ratio >= BRIGHTER and sums[1, k] / n - ERROR_M / np.sqrt(n) >= LEAST_M:
            score.flat[k], surface_m.flat[k] = SCORE_SPECULAR, f[NADIR_M, k]
        elif ratio >= BRIGHTEST:
            score.flat[k] = SCORE_SPECULAR
    return score, surface_m


@kernel_for_any_types
def _score(
    answered: np.float32, lost: np.float32, fewest: np.float32, table: tuple[tuple[float, ...], ...]
) -> np.float32:
    """Return the log odds for water by the share of rays answered, 0 where there are too few."""
    total = answered + lost
    return np.float32(interpolate(answered / total, table[0], table[1])) if total >= fewest else F0


@kernel_part
def _suspect_by_lost_rays(fields: Array3D[np.float32], score: Array2D[np.float32]) -> None:
    """Raise the score of seen cells that answered too few oblique rays to acquit them."""
    f, rays = fields.reshape(len(fields), -1), np.empty((5, *score.shape), np.float32)
    flat = rays.reshape(5, -1)
    for k in range(score.size):
        flat[0, k], flat[1, k], flat[2, k] = f[OBLIQUE, k], f[LOST_OBLIQUE, k], f[SLANTED, k]
        flat[3, k], flat[4, k] = f[LOST_SLANTED, k], f[REPORTED, k]
    near = box_sums(rays, AROUND).reshape(5, -1)
    for k in range(score.size):
        if f[COUNT, k] > F0 and f[OBLIQUE, k] < FEWEST_RAYS:
            lost = f[LOST_SLANTED, k] if f[REPORTED, k] >= FEWEST_REPORTED else F0
            suspect = _score(f[SLANTED, k], lost, FEWEST_RAYS, BY_SLANTED)
            lost, slanted = (near[1, k], near[3, k]) if near[4, k] >= FEWEST_REPORTED else (F0, F0)
            suspect = max(suspect, _score(near[0, k], lost, FEWEST_AROUND, BY_OBLIQUE))
            suspect = max(suspect, _score(near[2, k], slanted, FEWEST_AROUND, BY_SLANTED))
            score.flat[k] = max(score.flat[k], suspect, F0)


@kernel
def vanishing_returns(
    fields: Array3D[np.float32], level: Array2D[np.bool_], sees_obliquely: bool
) -> Array2D[np.float32]:
    """Return the log odds for water of every cell from its oblique and slanted rays; 0 where too few met it.

    Where too few met a cell, those of its neighbours count: that of lost ones makes it suspect, and that of
    answered ones makes it dry as far as both belong to a level extent, which is of one surface. A ray is lost
    by chance now and then, and its driver's report stands for several: few reports count as none.

    Parameters
    ----------
    level
        (rows, cols), cells of level extents.
    sees_obliquely
        Whether the sensor sees obliquely elsewhere.
    """
    f, on_level = fields.reshape(len(fields), -1), np.zeros_like(fields[:2])
    out: Array2D[np.float32] = np.zeros_like(fields[0])
    both, any_reported, any_oblique, any_silent = on_level.reshape(2, -1), False, False, False
    for k in range(out.size):
        oblique = f[OBLIQUE, k]
        lost = f[LOST_OBLIQUE, k] if f[REPORTED, k] >= FEWEST_REPORTED else F0
        out.flat[k] = _score(oblique, lost, FEWEST_RAYS, BY_OBLIQUE)
        any_reported |= f[REPORTED, k] != F0
        any_oblique |= oblique != F0
        if level.flat[k]:
            # What dark cells answered is no sign of dry ground: murky water answers so.
            both[0, k], both[1, k] = oblique if f[DARK, k] <= F0 else F0, lost
            any_silent |= f[COUNT, k] > F0 and oblique < FEWEST_RAYS
    if any_reported:
        _suspect_by_lost_rays(fields, out)
    elif sees_obliquely:
        near = box_sums(fields[OBLIQUE : OBLIQUE + 1], AROUND)
        for k in range(out.size):
            if level.flat[k] and f[COUNT, k] >= FEWEST_RAYS and near.flat[k] < F1:
                out.flat[k] = max(out.flat[k], SCORE_ABOVE)
    if any_silent and any_oblique:
        answered, not_answered = box_sums(on_level, EXTENT).reshape(2, -1)
        for k in range(out.size):
            silent = f[COUNT, k] > F0 and f[OBLIQUE, k] < FEWEST_RAYS
            if silent and level.flat[k] and out.flat[k] <= F0:
                out.flat[k] = min(_score(answered[k], not_answered[k], FEWEST_ON_EXTENT, BY_OBLIQUE), F0)
    return out
