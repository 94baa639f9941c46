"""Banks: the ground rises around water, goes on even around a pitch, and drops beside a terrace."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.surface.masks import filled
from slz.kernels.surface.shores import around_shore
from slz.surface.surface_cells import Flags, Floats, SurfaceCells, with_margin

BANK_M = 0.10  # ground higher than the water beside it by this is a bank
WALL_M, WALLED_M2 = 1.0, 400.0  # what rises more around a small extent is a wall or a tree, and tells nothing
BANK_CELLS = 4  # width of the ring in which banks are looked for
FEWEST_RING = 12  # cells of the ring that were seen
SECTORS = 12  # directions in which a bank is looked for
BANKED_M2, BANKED_SIDES = (100.0, 400.0, 1500.0, 4000.0), (7, 6, 3, 1)  # the larger, the fewer need a bank
BANKED_FALLING = 4  # as many for an extent that falls: a road along a slope has a bank on one side

SCORE_BANKS = 3.5
SCORE_EVEN = -2.5
SCORE_SPILL = -4.0


def banks(
    cells: SurfaceCells, labels: NDArray[np.int32], level_m: Floats, falling: Flags
) -> NDArray[np.float64]:
    """Return the log odds for water of each label from what lies around it: banks, even ground, or a drop.

    Banks on one side of a small extent are a wall beside a yard; a lake may be cut by the edge of a survey.

    Parameters
    ----------
    labels, level_m
        (rows, cols) of the extents, 0 for none, and the height of their surface, NaN for none.
    falling
        Of each label, whether its extent falls.
    """
    n = len(falling)
    count, sides = np.zeros((n, 3), np.int64), np.zeros(n, np.int64)
    size = np.maximum(np.bincount(labels.ravel(), minlength=n), 1)
    for label, own in with_margin(labels, n, BANK_CELLS):
        whole = filled(labels[own] == label)  # what stands within is no bank of it
        most_m = WALL_M if size[label] * cells.cell_m**2 < WALLED_M2 else np.inf
        beside = np.where(labels[own] == label, level_m[own], np.float32(np.nan))
        seen, mean = np.ascontiguousarray(cells.seen[own]), np.ascontiguousarray(cells.mean_m[own])
        limits = BANK_CELLS, BANK_M, most_m, SECTORS
        sides[label] = around_shore(whole, seen, mean, beside, *limits, count[label])
    total = count.sum(axis=1)
    up, down, even = (count / np.maximum(total, 1)[:, None]).T
    score = SCORE_EVEN * np.clip((even - 0.3) / 0.4, 0, 1) + SCORE_SPILL * np.clip((down - 0.03) / 0.15, 0, 1)
    fewest = np.interp(size * cells.cell_m**2, BANKED_M2, BANKED_SIDES)
    fewest = np.where(falling, np.maximum(fewest, BANKED_FALLING), fewest)
    score += SCORE_BANKS * np.clip((up - 0.35) / 0.35, 0, 1) * np.clip((sides - fewest) / 2, 0, 1)
    return np.asarray(np.where(total >= FEWEST_RING, score, 0.0))
