"""Penetration: plants let light pass, so returns of one place lie at several depths below its top.

SLZ thesis, section 2 (vegetation); the attenuation of a beam in leaves is that of Beer and Lambert.
A hard surface answers from one depth, except for few false returns, and along edges.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D, Array3D
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.surface.neighbourhood import box_sums
from slz.kernels.surface.piecewise_linear import F0, F1, ramp
from slz.kernels.surface.surface_record import COUNT, DEEP, SEVERAL, SQUARES, TALL, TOLD

AROUND = 2  # cells
FEWEST = 30.0  # returns of the neighbourhood
FALSE_SHARE = np.float32(0.01)  # of the returns of a cell, up to which others may be false
SPREAD_M = np.float32(0.06)  # within a cell; more than that of a hard surface on a slope
SCORE_PRIOR = np.float32(-4.0)
SCORE_PIERCED, SCORE_SPREAD, SCORE_SEVERAL = np.float32(6.0), np.float32(2.0), np.float32(3.0)
PIERCED, ROUGH, SHARES = np.float32(0.2), np.float32(0.5), np.float32(0.4)
SEVERAL_FROM, SEVERAL_SHARES = np.float32(0.02), np.float32(0.1)


@kernel_part
def spread_m(count: np.float32, squares: np.float32) -> np.float32:
    """Return the standard deviation of the heights within a cell, 0 where nothing was seen."""
    return np.float32(np.sqrt(max(squares, F0) / max(count, F1)))


@kernel
def penetration(fields: Array3D[np.float32]) -> Array2D[np.float32]:
    """Return the log odds for plants: of cells whose neighbourhood has returns from several depths."""
    f, layers = fields.reshape(len(fields), -1), np.zeros_like(fields[:6])
    flat, out = layers.reshape(6, -1), np.full(fields[0].shape, SCORE_PRIOR, np.float32)
    for k in range(f.shape[1]):
        count, apart = f[COUNT, k], f[DEEP, k] + f[TALL, k]
        flat[3, k], flat[4, k], flat[5, k] = f[TOLD, k], f[SEVERAL, k], count
        if count > F0:
            flat[0, k] = F1
            flat[1, k] = apart >= F1 and apart > FALSE_SHARE * count
            flat[2, k] = spread_m(count, f[SQUARES, k]) > SPREAD_M
    places, pierced, rough, told, several, around = box_sums(layers, AROUND).reshape(6, -1)
    for k in range(f.shape[1]):
        if f[COUNT, k] > F0 and around[k] >= FEWEST:
            n = max(places[k], F1)
            score = SCORE_PRIOR + SCORE_PIERCED * ramp(pierced[k] / n, PIERCED, SHARES)
            score += SCORE_SPREAD * ramp(rough[k] / n, ROUGH, SHARES)
            if told[k] >= FEWEST:
                share = several[k] / max(told[k], F1)
                score += SCORE_SEVERAL * ramp(share, SEVERAL_FROM, SEVERAL_SHARES)
            out.flat[k] = score
    return out
