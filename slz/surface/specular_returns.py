"""Specular returns: shallow water answers brightly from above, and its bottom, dim and lower, from aside.

The surface of water in a breeze is a mirror up to 10 degrees of incidence (Cox and Munk, 1954; Bufton, Hoge
and Swift, 1983), the bottom shows beyond, and lies 1.33 times deeper than it is. Wet tarmac shines as well,
but at one height; plants let rays from above deeper than those from aside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slz.kernels.surface.neighbourhood import box_sums
from slz.kernels.surface.surface_record import ASIDE, ASIDE_LIGHT, ASIDE_M, NADIR, NADIR_LIGHT, NADIR_M
from slz.surface.surface_cells import Floats, SurfaceCells

FEWEST = 2.0  # returns of a cell from above, and from aside, whose heights compare
AROUND = 2  # cells
FEWEST_PAIRS = 6.0  # of the neighbourhood
BRIGHTER, BRIGHTEST = 2.0, 6.0  # from above than from aside: dry ground 1.0 to 1.2, wet tarmac 2 to 5
LEAST_M, NOISE_M, SIGMAS = 0.02, 0.03, 3.0  # of the bottom below the surface; of a return; standard errors
SCORE = 4.5  # log odds


@dataclass(frozen=True, slots=True)
class SpecularReturns:
    """log_odds: (rows, cols), for water. surface_m: (rows, cols), its height over a bottom seen, else NaN."""

    log_odds: Floats
    surface_m: Floats


def specular_returns(cells: SurfaceCells) -> SpecularReturns:
    """Tell water from what was seen of a cell and its neighbours from above and from aside.

    The neighbours make up for few returns; each cell must shine by itself.
    """
    f = cells.fields
    above, above_m, above_light = f[NADIR], f[NADIR_M], f[NADIR_LIGHT]
    aside, aside_m, aside_light = f[ASIDE], f[ASIDE_M], f[ASIDE_LIGHT]
    both = (above >= FEWEST) & (aside >= FEWEST)
    if not both.any():
        return SpecularReturns(np.zeros(cells.shape, np.float32), np.full(cells.shape, np.nan, np.float32))
    above, aside = above * both, aside * both
    pairs = above * aside / np.maximum(above + aside, 1)
    light = above, above * above_light, aside, aside * aside_light
    sums = box_sums(np.stack([pairs, pairs * (above_m - aside_m), *light]), AROUND)
    n = np.maximum(sums[0], 1)
    enough, dim = sums[0] >= FEWEST_PAIRS, sums[5] / np.maximum(sums[4], 1)
    ratio = sums[3] / np.maximum(sums[2] * dim, 1e-6)
    drop = sums[1] / n - SIGMAS * NOISE_M / np.sqrt(n)
    shines = enough & both & (above_light >= BRIGHTER * dim)
    over_bottom = shines & (ratio >= BRIGHTER) & (drop >= LEAST_M)
    told = over_bottom | (shines & (ratio >= BRIGHTEST))
    return SpecularReturns(
        np.where(told, np.float32(SCORE), np.float32(0)), np.where(over_bottom, above_m, np.float32(np.nan))
    )
