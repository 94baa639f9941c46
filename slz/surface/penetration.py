"""Penetration: plants let light pass, so returns of one place lie at several depths below its top.

SLZ thesis, section 2 (vegetation); the attenuation of a beam in leaves is that of Beer and Lambert.
A hard surface answers from one depth, except for few false returns, and along edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slz.kernels.surface.neighbourhood import box_sums
from slz.kernels.surface.surface_record import COUNT, DEEP, HIGH, LOW, SEVERAL, TALL, TOLD
from slz.surface.surface_cells import Floats, SurfaceCells

AROUND = 2  # cells
FEWEST = 30.0  # returns of the neighbourhood
DEPTH_M = 2.5  # of crops and reeds; what is taller is canopy
SPREAD_M = 0.06  # within a cell; more than that of a hard surface on a slope
SCORE_PRIOR = -4.0
SCORE_PIERCED, SCORE_SPREAD, SCORE_SEVERAL = 6.0, 2.0, 3.0


@dataclass(frozen=True, slots=True)
class Penetration:
    """log_odds: (rows, cols), for plants. depth_m: (rows, cols), between lowest and highest returns."""

    log_odds: Floats
    depth_m: Floats


def penetration(cells: SurfaceCells) -> Penetration:
    """Find the cells whose returns come from several depths, all over their neighbourhood."""
    f, seen = cells.fields, cells.seen
    apart = f[DEEP] + f[TALL]
    pierced = seen & (apart >= 1) & (apart > 0.01 * f[COUNT])
    rough = seen & (cells.spread_m > SPREAD_M)
    layers = np.stack([seen, pierced, rough, f[TOLD], f[SEVERAL], f[COUNT]]).astype(np.float32)
    places, n_pierced, n_rough, told, several, count = box_sums(layers, AROUND)
    places = np.maximum(places, 1)
    score = SCORE_PRIOR + SCORE_PIERCED * np.clip((n_pierced / places - 0.2) / 0.4, 0, 1)
    score += SCORE_SPREAD * np.clip((n_rough / places - 0.5) / 0.4, 0, 1)
    if told.any():
        share = several / np.maximum(told, 1)
        score += np.where(told >= FEWEST, SCORE_SEVERAL * np.clip((share - 0.02) / 0.1, 0, 1), 0)
    score = np.where(seen & (count >= FEWEST), score, SCORE_PRIOR)
    depth = np.where(seen, f[HIGH] - f[LOW], 0)
    return Penetration(np.asarray(score, np.float32), np.asarray(depth, np.float32))
