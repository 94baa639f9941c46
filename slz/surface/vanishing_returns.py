"""Returns that vanish with incidence: still water answers near nadir only, dry ground obliquely as well.

Water reflects like a mirror whose facets lean by the slope of its waves (Cox and Munk, 1954), and absorbs
what enters it: at 905 nm it answers a ray at more than 25 degrees of incidence only in a gale. A dark, wet
surface answers with 0.02 of the light of a white one, enough up to `ANSWER_M`.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.surface.surface_record import LOST, OBLIQUE
from slz.surface.level_extents import LevelExtents
from slz.surface.surface_cells import Flags, Floats, SurfaceCells, sum_around

FEWEST_RAYS = 4.0  # oblique rays of a cell that decide
AROUND = 2  # cells; where a cell has too few rays of its own
FEWEST_LOST = 8.0  # of the neighbourhood
EXTENT, FEWEST_ON_EXTENT = 10, 40.0  # cells around, and rays there on the same level extent
ANSWERED = 0.75  # share of oblique rays with a return, above which a surface is no water
LEFT = 0.2  # and below which it is
SCORE_DRY = -6.0
SCORE_WATER = 4.5


def vanishing_returns(cells: SurfaceCells, extents: LevelExtents) -> Floats:
    """Return the log odds for water of every cell from its oblique rays; 0 where too few met it.

    Where too few met a cell, those of its neighbours tell: that of lost ones makes it suspect, and that of
    answered ones makes it dry as far as both belong to one level extent, which is of one surface.
    """
    oblique, lost = cells.fields[OBLIQUE], cells.fields[LOST]
    score = _score(oblique, lost, FEWEST_RAYS)
    silent = cells.seen & (oblique + lost < FEWEST_RAYS)
    if not silent.any():
        return score
    if lost.any():
        near = _score(sum_around(oblique, AROUND), sum_around(lost, AROUND), FEWEST_LOST)
        score = np.where(silent, np.maximum(near, 0), score)
    level = extents.labels > 0
    if (silent & level).any() and oblique.any():
        answered, silent_rays = (
            sum_around(np.where(level, rays, np.float32(0)), EXTENT) for rays in (oblique, lost)
        )
        on_extent = np.minimum(_score(answered, silent_rays, FEWEST_ON_EXTENT), 0)
        score = np.where(silent & level & (score <= 0), on_extent, score)
    return np.asarray(score, np.float32)


def was_looked_at(cells: SurfaceCells) -> Flags:
    """Return the cells that enough oblique rays met."""
    return np.asarray(cells.fields[OBLIQUE] + cells.fields[LOST] >= FEWEST_RAYS)


def _score(oblique: Floats, lost: Floats, fewest: float) -> Floats:
    total = oblique + lost
    share = oblique / np.maximum(total, 1)
    score = np.interp(share, [LEFT / 2, LEFT, ANSWERED, 1.0], [SCORE_WATER, 2.5, SCORE_DRY / 2, SCORE_DRY])
    return np.asarray(np.where(total >= fewest, score, 0.0), np.float32)
