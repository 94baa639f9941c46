"""Returns that vanish with incidence: still water answers near nadir only, dry ground obliquely as well.

Water reflects like a mirror whose facets lean by the slope of its waves (Cox and Munk, 1954), and absorbs
what enters it: at 905 nm it answers a ray at more than 25 degrees of incidence only in a gale. A dark, wet
surface answers with 0.02 of the light of a white one, enough up to `ANSWER_M`.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array2D, Array3D
from slz.kernels.jit import kernel, kernel_for_any_types, kernel_part
from slz.kernels.surface.neighbourhood import box_sums
from slz.kernels.surface.piecewise_linear import F0, F1, interpolate
from slz.kernels.surface.surface_record import (
    COUNT,
    DARK,
    LOST_OBLIQUE,
    LOST_SLANTED,
    OBLIQUE,
    REPORTED,
    SLANTED,
)

FEWEST_RAYS = np.float32(4.0)  # of a cell that decide
FEWEST_REPORTED = np.float32(3.0)  # lost rays that are no chance
AROUND = 2  # cells; where a cell has too few rays of its own
FEWEST_AROUND = np.float32(8.0)  # rays of the neighbourhood
SCORE_ABOVE = np.float32(4.0)  # of a level cell seen from above alone, where no lost ray is reported
EXTENT, FEWEST_ON_EXTENT = 10, np.float32(40.0)  # cells around, and rays there on the same level extent
# Shares of rays answered, and log odds. Water in wind answers slanted rays, so that they never make it dry.
BY_OBLIQUE = (0.1, 0.2, 0.75, 1.0), (4.5, 2.5, -3.0, -6.0)
BY_SLANTED = (0.3, 0.6, 0.85, 0.95), (4.0, 3.0, 0.5, 0.0)


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

    Where too few met a cell, those of its neighbours tell: that of lost ones makes it suspect, and that of
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
