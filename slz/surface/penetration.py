"""Penetration: plants let light pass, so returns of one place lie at several depths below its top.

SLZ thesis, section 2 (vegetation); the attenuation of a beam in leaves is that of Beer and Lambert.
A hard surface answers from one depth, except for few false returns, and along edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slz.kernels.surface.surface_record import COUNT, DEEP, HIGH, LOW, SEVERAL, TALL, TOLD
from slz.surface.surface_cells import Floats, SurfaceCells, sum_around

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
    f = cells.fields
    count = np.maximum(f[COUNT], 1)
    apart = (f[DEEP] + f[TALL]) / count
    pierced = cells.seen & (f[DEEP] + f[TALL] >= 1) & (apart > 0.01)
    places = np.maximum(sum_around(cells.seen.astype(np.float32), AROUND), 1)
    everywhere = sum_around(pierced.astype(np.float32), AROUND) / places
    spread = np.where(cells.seen, cells.spread_m, 0)
    rough = sum_around((spread > SPREAD_M).astype(np.float32), AROUND) / places
    told, several = sum_around(f[TOLD], AROUND), sum_around(f[SEVERAL], AROUND)
    share = several / np.maximum(told, 1)
    score = SCORE_PRIOR + SCORE_PIERCED * np.clip((everywhere - 0.2) / 0.4, 0, 1)
    score += SCORE_SPREAD * np.clip((rough - 0.5) / 0.4, 0, 1)
    score += np.where(told >= FEWEST, SCORE_SEVERAL * np.clip((share - 0.02) / 0.1, 0, 1), 0)
    depth = np.where(cells.seen, f[HIGH] - f[LOW], 0)
    score = np.where(cells.seen & (sum_around(f[COUNT], AROUND) >= FEWEST), score, SCORE_PRIOR)
    return Penetration(np.asarray(score, np.float32), np.asarray(depth, np.float32))
