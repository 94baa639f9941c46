"""Flooded ground: what lies lower than standing water beside it is under that water.

Shallow water shows its bottom, which answers obliquely as land does, 1.33 times deeper than it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slz.kernels.surface.shores import flood
from slz.kernels.surface.surface_record import ASIDE, ASIDE_LIGHT
from slz.surface.level_extents import LevelExtents
from slz.surface.specular_returns import FEWEST, SpecularReturns
from slz.surface.surface_cells import Floats, SurfaceCells

SEED = 0.2  # probability of water
FEWEST_M2, FEWEST_SHINING_M2 = 20.0, 8.0  # of seeds of one level
SURFACE_SHARE = 0.75  # of the heights of seeds, up to which a bottom may show
LEAST_M, DEEPEST_M = 0.01, 0.4  # below the level, from which a bottom is told and to which it shows
BRIGHTEST_BOTTOM = 0.22  # share of a white target; light loses half at the surface of water, even over sand
ONE_LEVEL_M = 0.15  # between low and high seeds that shine, with waves, and a bottom that draws them down
SHARES = 0.1, SURFACE_SHARE, 0.9


def with_flooded_ground(
    water: NDArray[np.floating], cells: SurfaceCells, extents: LevelExtents, mirror: SpecularReturns
) -> NDArray[np.floating]:
    """Return the probabilities of water, those of flooded ground as that of the water which floods it.

    Water that floods is that of level extents, and that which shines from above over a bottom seen from
    aside, at the height that it has from above.
    """
    above = cells.mean_m - np.nan_to_num(extents.level_m)
    water = _flooded(water, cells, extents.labels, extents.level_m, above, FEWEST_M2, np.inf)
    shines = np.isfinite(mirror.surface_m)
    if not shines.any():
        return water
    labels = np.asarray(ndimage.label(shines)[0], np.int32)
    level = np.zeros(cells.shape, np.float32)
    return _flooded(water, cells, labels, level, mirror.surface_m, FEWEST_SHINING_M2, ONE_LEVEL_M)


def _flooded(
    water: NDArray[np.floating],
    cells: SurfaceCells,
    labels: NDArray[np.int32],
    level: Floats,
    above: Floats,
    fewest_m2: float,
    one_level_m: float,
) -> NDArray[np.floating]:
    """Return the probabilities of water with what the probable water of each label floods.

    The water of a label is at one height above its level, which may fall.
    """
    seeds = np.where(cells.seen & (water >= SEED), labels, 0).astype(np.int32)
    size = np.bincount(seeds.ravel()) * cells.cell_m**2
    size[0] = 0
    raised = np.full(len(size), np.nan, np.float32)
    for label in np.flatnonzero(size >= fewest_m2).tolist():
        ranked = np.sort(above[seeds == label])
        low, own, high = (ranked[int(share * len(ranked))] for share in SHARES)
        if high - low <= one_level_m:
            raised[label] = own  # a bottom that shows here and there draws the mean down
    if not np.isfinite(raised).any():
        return water
    seeds[~np.isfinite(raised)[seeds]] = 0
    n = np.maximum(np.bincount(seeds.ravel(), minlength=len(size)), 1)
    of_seeds = np.bincount(seeds.ravel(), water.ravel(), len(size)) / n
    f = cells.fields
    dry = (f[ASIDE] >= FEWEST) & (f[ASIDE_LIGHT] > BRIGHTEST_BOTTOM)
    over = np.ascontiguousarray(level + raised[seeds])
    mean = np.ascontiguousarray(cells.mean_m)
    under = flood(seeds, over, cells.seen & ~dry, mean, LEAST_M, DEEPEST_M)
    return np.where(under > 0, np.maximum(water, of_seeds[under]), water)
