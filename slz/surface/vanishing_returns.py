"""Returns that vanish with incidence: still water answers near nadir only, dry ground obliquely as well.

Water reflects like a mirror whose facets lean by the slope of its waves (Cox and Munk, 1954), and absorbs
what enters it: at 905 nm it answers a ray at more than 25 degrees of incidence only in a gale. A dark, wet
surface answers with 0.02 of the light of a white one, enough up to `ANSWER_M`.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.surface.neighbourhood import box_sums
from slz.kernels.surface.surface_record import (
    COUNT,
    DARK,
    LOST_OBLIQUE,
    LOST_SLANTED,
    OBLIQUE,
    REPORTED,
    SLANTED,
)
from slz.surface.surface_cells import Flags, Floats, SurfaceCells

FEWEST_RAYS = 4.0  # of a cell that decide
FEWEST_REPORTED = 3.0  # lost rays that are no chance
AROUND = 2  # cells; where a cell has too few rays of its own
FEWEST_AROUND = 8.0  # rays of the neighbourhood
SCORE_ABOVE = 4.0  # of a level cell seen from above alone, where no lost ray is reported
EXTENT, FEWEST_ON_EXTENT = 10, 40.0  # cells around, and rays there on the same level extent
# Shares of rays answered, and log odds. Water in wind answers slanted rays, so that they never make it dry.
OBLIQUE_SHARES, OBLIQUE_SCORES = (0.1, 0.2, 0.75, 1.0), (4.5, 2.5, -3.0, -6.0)
SLANTED_SHARES, SLANTED_SCORES = (0.3, 0.6, 0.85, 0.95), (4.0, 3.0, 0.5, 0.0)


def vanishing_returns(cells: SurfaceCells, level: Flags, sees_obliquely: bool = False) -> Floats:
    """Return the log odds for water of every cell from its oblique and slanted rays; 0 where too few met it.

    Where too few met a cell, those of its neighbours tell: that of lost ones makes it suspect, and that of
    answered ones makes it dry as far as both belong to a level extent, which is of one surface.

    Parameters
    ----------
    level
        (rows, cols), cells of level extents.
    sees_obliquely
        Whether the sensor sees obliquely elsewhere.
    """
    f = cells.fields
    rays = np.stack([f[OBLIQUE], f[LOST_OBLIQUE], f[SLANTED], f[LOST_SLANTED], f[REPORTED]])
    oblique, lost, slanted, lost_slanted = _by_chance_left_out(rays)
    score = _score(oblique, lost, FEWEST_RAYS, OBLIQUE_SHARES, OBLIQUE_SCORES)
    silent = cells.seen & (oblique < FEWEST_RAYS)  # too few answered to acquit it
    if f[REPORTED].any():
        own = _score(slanted, lost_slanted, FEWEST_RAYS, SLANTED_SHARES, SLANTED_SCORES)
        near = _by_chance_left_out(box_sums(rays, AROUND))
        by_oblique = _score(near[0], near[1], FEWEST_AROUND, OBLIQUE_SHARES, OBLIQUE_SCORES)
        by_slanted = _score(near[2], near[3], FEWEST_AROUND, SLANTED_SHARES, SLANTED_SCORES)
        suspect = np.maximum(np.maximum(own, by_slanted), np.maximum(by_oblique, 0))
        score = np.where(silent, np.maximum(score, suspect), score)
    elif sees_obliquely:
        above = level & (f[COUNT] >= FEWEST_RAYS) & (box_sums(f[OBLIQUE][np.newaxis], AROUND)[0] < 1)
        score = np.where(above, np.maximum(score, np.float32(SCORE_ABOVE)), score)
    if (silent & level).any() and oblique.any():
        # What dark cells answered is no sign of dry ground: murky water answers so.
        around, without = box_sums(np.stack([oblique * (f[DARK] <= 0), lost]) * level, EXTENT)
        on_extent = _score(around, without, FEWEST_ON_EXTENT, OBLIQUE_SHARES, OBLIQUE_SCORES)
        score = np.where(silent & level & (score <= 0), np.minimum(on_extent, 0), score)
    return np.asarray(score, np.float32)


def _by_chance_left_out(rays: Floats) -> Floats:
    """Return (4, rows, cols) of oblique and slanted rays, answered and lost; without lost ones where few are.

    A ray is lost by chance now and then, and its driver's report stands for several.
    """
    out = rays[:4].copy()
    out[1::2, rays[4] < FEWEST_REPORTED] = 0
    return out


def _score(
    answered: Floats, lost: Floats, fewest: float, shares: tuple[float, ...], scores: tuple[float, ...]
) -> Floats:
    """Return the log odds of the cells with enough rays, 0 elsewhere."""
    total = answered + lost
    told, score = total >= fewest, np.zeros(total.shape, np.float32)
    score[told] = np.interp(answered[told] / total[told], shares, scores)
    return score
