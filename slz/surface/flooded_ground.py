"""Flooded ground: what lies lower than standing water beside it is under that water.

Shallow water shows its bottom, which answers obliquely as land does, 1.33 times deeper than it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.surface.shores import flood
from slz.surface.level_extents import LevelExtents
from slz.surface.surface_cells import Floats, SurfaceCells

SEED = 0.2  # probability of water
FEWEST_M2 = 20.0  # of seeds of one level
SURFACE_SHARE = 0.75  # of the heights of seeds, up to which a bottom may show
LEAST_M, DEEPEST_M = 0.01, 0.4  # below the level, from which a bottom is told and to which it shows


def with_flooded_ground(
    water: NDArray[np.floating], cells: SurfaceCells, extents: LevelExtents
) -> NDArray[np.floating]:
    """Return the probabilities of water, those of flooded ground as that of the water which floods it."""
    seeds = np.where(cells.seen & (water >= SEED), extents.labels, 0).astype(np.int32)
    size = np.bincount(seeds.ravel(), minlength=len(extents.level_m)) * cells.cell_m**2
    size[0] = 0
    enough = size >= FEWEST_M2
    if not enough.any():
        return water
    seeds[~enough[seeds]] = 0
    mean: Floats = np.ascontiguousarray(cells.mean_m)
    seen_seeds = seeds.ravel()
    n = np.maximum(np.bincount(seen_seeds, minlength=len(size)), 1)
    level = np.full(len(size), np.nan)
    for label in np.flatnonzero(enough).tolist():  # a bottom that shows here and there draws the mean down
        level[label] = np.quantile(mean.ravel()[seen_seeds == label], SURFACE_SHARE)
    of_seeds = np.bincount(seen_seeds, water.ravel(), len(size)) / n
    under = flood(seeds, cells.seen, mean, level, LEAST_M, DEEPEST_M)
    return np.where(under > 0, np.maximum(water, of_seeds[under]), water)
