"""Flooded ground: what lies lower than standing water beside it is under that water.

Shallow water shows its bottom, which answers obliquely as land does, 1.33 times deeper than it is.
"""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array2D, Array3D
from slz.kernels.elementary_functions import ranked
from slz.kernels.jit import kernel_part
from slz.kernels.surface.masks import connected_parts
from slz.kernels.surface.shores import flood
from slz.kernels.surface.surface_record import ASIDE, ASIDE_LIGHT, COUNT, MEAN
from slz.kernels.surface.water_returns import FEWEST_RETURNS

SEED = 0.2  # probability of water
FEWEST_M2, FEWEST_SHINING_M2 = 20.0, 8.0  # of seeds of one level
LEAST_M, DEEPEST_M = (
    0.01,
    0.4,
)  # below the level, least depth of a recognised bottom, greatest of a visible one
BRIGHTEST_BOTTOM = np.float32(0.22)  # share of a white target; water halves light, even over sand
ONE_LEVEL_M = np.float32(0.15)  # between low and high seeds that shine, with waves, and a bottom drawing down
EVERY_LEVEL_M = np.float32(np.inf)
LOW, SURFACE, HIGH = 0.1, 0.75, 0.9  # shares of the heights of seeds, up to which a bottom may show


@kernel_part
def flood_ground(
    water: Array2D[np.float64],
    fields: Array3D[np.float32],
    labels: Array2D[np.int32],
    level_m: Array2D[np.float32],
    surface_m: Array2D[np.float32],
    cell: float,
) -> bool:
    """Raise the probabilities of water of flooded ground to that of the water which floods it.

    Water that floods is that of level extents, and that which shines from above over a bottom seen from
    aside, at the height that it has from above. Return whether there is any.

    Parameters
    ----------
    labels, level_m, surface_m
        (rows, cols) of level extents, and of `specular_returns`.
    """
    above, level = fields[MEAN].copy(), np.zeros_like(level_m)
    for k in range(above.size):
        if labels.flat[k] > 0:
            level.flat[k] = level_m.flat[k]
            above.flat[k] -= level.flat[k]
    any_water = _flood(water, fields, labels, level, above, cell**2, FEWEST_M2, EVERY_LEVEL_M)
    shines, any_shines = np.empty(labels.shape, np.bool_), False
    for k in range(level.size):
        shines.flat[k], level.flat[k] = surface_m.flat[k] == surface_m.flat[k], 0
        any_shines |= bool(shines.flat[k])
    if any_shines:
        mirrors = connected_parts(shines, 1.0, 1.0)[0]
        any_water |= _flood(water, fields, mirrors, level, surface_m, cell**2, FEWEST_SHINING_M2, ONE_LEVEL_M)
    return any_water


@kernel_part
def _flood(
    water: Array2D[np.float64],
    fields: Array3D[np.float32],
    labels: Array2D[np.int32],
    level: Array2D[np.float32],
    above: Array2D[np.float32],
    cell_m2: float,
    least_m2: float,
    one_level_m: np.float32,
) -> bool:
    """Flood from the probable water of each label, which is at one height above its level that may fall."""
    f, seeds, n_labels = fields.reshape(len(fields), -1), np.zeros(labels.shape, np.int32), 1
    for k in range(labels.size):
        n_labels = max(n_labels, int(labels.flat[k]) + 1)
    size, place, total = np.zeros(n_labels, np.int64), np.zeros(n_labels, np.int64), np.zeros(n_labels)
    for k in range(labels.size):
        if labels.flat[k] > 0 and f[COUNT, k] > 0 and water.flat[k] >= SEED:
            own = seeds.flat[k] = labels.flat[k]
            size[own] += 1
            total[own] += water.flat[k]
    for label in range(1, n_labels):
        place[label] = place[label - 1] + size[label - 1]
    heights, any_raised = np.empty(place[-1] + size[-1], np.float32), False
    raised = np.full(n_labels, np.nan, np.float32)
    for k in range(labels.size):
        own = seeds.flat[k]
        if own > 0:
            heights[place[own]] = above.flat[k]
            place[own] += 1
    for label in range(1, n_labels):
        n = size[label]
        if n * cell_m2 >= least_m2:
            of = heights[place[label] - n : place[label]]
            if ranked(of, int(HIGH * n)) - ranked(of, int(LOW * n)) <= one_level_m:
                raised[label] = ranked(of, int(SURFACE * n))  # a bottom that shows here and there draws down
                any_raised |= not math.isnan(raised[label])
    if not any_raised:
        return False
    may, over = np.empty(labels.shape, np.bool_), level.copy()
    for k in range(labels.size):
        is_bright = f[ASIDE, k] >= FEWEST_RETURNS and f[ASIDE_LIGHT, k] > BRIGHTEST_BOTTOM
        may.flat[k] = f[COUNT, k] > 0 and not is_bright
        over.flat[k] += raised[seeds.flat[k]]
        if math.isnan(raised[seeds.flat[k]]):
            seeds.flat[k] = 0
    flood(seeds, over, may, fields[MEAN], LEAST_M, DEEPEST_M)
    for k in range(labels.size):
        own = seeds.flat[k]
        if own > 0:
            water.flat[k] = max(water.flat[k], total[own] / size[own])
    return True
