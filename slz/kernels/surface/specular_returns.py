"""Specular returns: shallow water answers brightly from above, and its bottom, dim and lower, from aside.

The surface of water in a breeze is a mirror up to 10 degrees of incidence (Cox and Munk, 1954; Bufton, Hoge
and Swift, 1983), the bottom shows beyond, and lies 1.33 times deeper than it is. Wet tarmac shines as well,
but at one height; plants let rays from above deeper than those from aside.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D, Array3D
from slz.kernels.jit import kernel
from slz.kernels.surface.neighbourhood import box_sums
from slz.kernels.surface.piecewise_linear import F1
from slz.kernels.surface.surface_record import ASIDE, ASIDE_LIGHT, ASIDE_M, NADIR, NADIR_LIGHT, NADIR_M

FEWEST = np.float32(2.0)  # returns of a cell from above, and from aside, whose heights compare
AROUND = 2  # cells
FEWEST_PAIRS = np.float32(6.0)  # of the neighbourhood
BRIGHTER, BRIGHTEST = np.float32(2.0), np.float32(6.0)  # than from aside: dry 1.0 to 1.2, wet tarmac 2 to 5
LEAST_M = np.float32(0.02)  # of the bottom below the surface
ERROR_M = np.float32(3.0 * 0.03)  # three standard errors of a drop, of one pair of returns
LEAST_LIGHT = np.float32(1e-6)
SCORE = np.float32(4.5)  # log odds


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
        if above >= FEWEST and aside >= FEWEST:
            pairs, any_both = above * aside / max(above + aside, F1), True
            flat[0, k], flat[1, k] = pairs, pairs * (f[NADIR_M, k] - f[ASIDE_M, k])
            flat[2, k], flat[3, k] = above, above * f[NADIR_LIGHT, k]
            flat[4, k], flat[5, k] = aside, aside * f[ASIDE_LIGHT, k]
    if not any_both:
        return score, surface_m
    sums = box_sums(layers, AROUND).reshape(6, -1)
    for k in range(f.shape[1]):
        n, dim = max(sums[0, k], F1), sums[5, k] / max(sums[4, k], F1)
        if flat[2, k] < FEWEST or n < FEWEST_PAIRS or f[NADIR_LIGHT, k] < BRIGHTER * dim:
            continue
        ratio = sums[3, k] / max(sums[2, k] * dim, LEAST_LIGHT)
        if ratio >= BRIGHTER and sums[1, k] / n - ERROR_M / np.sqrt(n) >= LEAST_M:
            score.flat[k], surface_m.flat[k] = SCORE, f[NADIR_M, k]
        elif ratio >= BRIGHTEST:
            score.flat[k] = SCORE
    return score, surface_m
