"""Specular returns: shallow water answers brightly from above, and its bottom, dim and lower, from aside.

The surface of water in a breeze is a mirror up to 10 degrees of incidence (Cox and Munk, 1954; Bufton, Hoge
and Swift, 1983), the bottom shows beyond, and lies 1.33 times deeper than it is. Wet tarmac shines as well,
but at one height; plants let rays from above deeper than those from aside.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.surface.neighbourhood import box_sums
from slz.kernels.surface.surface_record import ASIDE, ASIDE_LIGHT, ASIDE_M, NADIR, NADIR_LIGHT, NADIR_M
from slz.surface.surface_cells import Floats, SurfaceCells

FEWEST = 2.0  # returns of a cell from above, and from aside, whose heights compare
AROUND = 2  # cells
FEWEST_PAIRS = 6.0  # of the neighbourhood
BRIGHTER, BRIGHTEST = 2.0, 4.5  # from above than from aside: dry ground 1.0 to 1.2, wet tarmac 2 to 4
LEAST_M, NOISE_M, SIGMAS = 0.02, 0.03, 3.0  # of the bottom below the surface; of a return; standard errors
SCORE = 4.5  # log odds


def specular_returns(cells: SurfaceCells) -> Floats:
    """Return the log odds for water of every cell that was seen from above and from aside; 0 elsewhere."""
    f = cells.fields
    above, above_m, above_light = f[NADIR], f[NADIR_M], f[NADIR_LIGHT]
    aside, aside_m, aside_light = f[ASIDE], f[ASIDE_M], f[ASIDE_LIGHT]
    both = (above >= FEWEST) & (aside >= FEWEST)
    if not both.any():
        return np.zeros(cells.shape, np.float32)
    above, aside = above * both, aside * both
    pairs = above * aside / np.maximum(above + aside, 1)
    sums = box_sums(
        np.stack(
            [pairs, pairs * (above_m - aside_m), above, above * above_light, aside, aside * aside_light]
        ),
        AROUND,
    )
    n = np.maximum(sums[0], 1)
    drop = sums[1] / n - SIGMAS * NOISE_M / np.sqrt(n)
    ratio = sums[3] * sums[4] / np.maximum(sums[5] * sums[2], 1e-6)
    shines = (ratio >= BRIGHTEST) | ((ratio >= BRIGHTER) & (drop >= LEAST_M))
    return np.where((sums[0] >= FEWEST_PAIRS) & shines, np.float32(SCORE), np.float32(0))
