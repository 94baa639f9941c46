"""Banks: the ground rises around water, goes on even around a pitch, and drops beside a terrace."""

from __future__ import annotations

import itertools
import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.elementary_functions import interpolate, ramp
from slz.kernels.jit import kernel_part
from slz.kernels.surface.masks import bounding_boxes, box_sums, with_holes

BANK_M = 0.10  # ground higher than the water beside it by this is a bank
WALL_M, WALLED_M2 = (
    1.0,
    400.0,
)  # what rises more around a small extent is a wall or tree: no evidence
BANK_CELLS = 4  # width of the ring in which banks are looked for
FEWEST_RING = 12  # cells of the ring that were seen
SECTORS = 12  # directions in which a bank is looked for
BANKED_M2, BANKED_SIDES = (100.0, 400.0, 1500.0, 4000.0), (7.0, 6.0, 3.0, 1.0)  # the larger, the fewer banks
BANKED_FALLING = 4  # as many for an extent that falls: a road along a slope has a bank on one side

SCORE_BANKS = 3.5
SCORE_EVEN = -2.5
SCORE_SPILL = -4.0
UP, DOWN, EVEN = range(3)
RING = np.arange(-BANK_CELLS, BANK_CELLS + 1)
# Rows and columns to all cells of a square, the nearest first.
NEAREST = np.array(sorted(itertools.product(RING, RING), key=lambda at: at[0] ** 2 + at[1] ** 2))


@kernel_part
def banks(
    count: Array2D[np.float32],
    mean: Array2D[np.float32],
    labels: Array2D[np.int32],
    level_m: Array2D[np.float32],
    falling: Array1D[np.bool_],
    cell: float,
) -> Array1D[np.float64]:
    """Return the log odds for water of each label from what lies around it: banks, even ground, or a drop.

    Banks on one side of a small extent are a wall beside a yard; a lake may be cut by the edge of a survey.

    Parameters
    ----------
    count, mean
        (rows, cols), returns and their mean height.
    labels, level_m
        (rows, cols) of the extents, 0 for none, and the height of their surface.
    falling
        Of each label, whether its extent falls.
    """
    n = len(falling)
    score, size, kinds = np.zeros(n), np.zeros(n, np.int64), np.zeros(3, np.int64)
    for k in range(labels.size):
        size[labels.flat[k]] += 1
    boxes = bounding_boxes(labels, n, BANK_CELLS)
    for label in range(1, n):
        if size[label] == 0:
            continue
        kinds[:] = 0
        m2 = size[label] * cell**2
        most_m = WALL_M if m2 < WALLED_M2 else math.inf
        sides = around_shore(count, mean, labels, level_m, label, boxes[label], most_m, kinds)
        total = kinds[UP] + kinds[DOWN] + kinds[EVEN]
        if total < FEWEST_RING:
            continue
        up, down, even = kinds[UP] / total, kinds[DOWN] / total, kinds[EVEN] / total
        fewest = interpolate(m2, BANKED_M2, BANKED_SIDES)
        if falling[label]:
            fewest = max(fewest, BANKED_FALLING)
        score[label] = SCORE_EVEN * ramp(even, 0.3, 0.4) + SCORE_SPILL * ramp(down, 0.03, 0.15)
        score[label] += SCORE_BANKS * ramp(up, 0.35, 0.35) * ramp(sides, fewest, 2.0)
    return score


@kernel_part
def around_shore(
    count: Array2D[np.float32],
    mean: Array2D[np.float32],
    labels: Array2D[np.int32],
    level_m: Array2D[np.float32],
    label: int,
    box: Array1D[np.int64],
    most_m: float,
    kinds: Array1D[np.int64],
) -> int:
    """Count the cells around an extent: UP, DOWN, EVEN by `BANK_M`, into `kinds`; none higher than `most_m`.

    A cell is compared with the nearest level within `BANK_CELLS` cells; what stands within the extent is
    none. Return the number of directions from its middle, of `SECTORS`, in which most of them are up.

    Parameters
    ----------
    box
        First and last row and column of the extent with a margin of `BANK_CELLS`.
    """
    row0, col0 = box[0], box[2]
    whole, toward = with_holes(labels, label, box), np.zeros((SECTORS, 2), np.int64)
    rows, cols = whole.shape
    own, middle_row, middle_col, n = np.zeros((1, rows, cols), np.float32), 0.0, 0.0, 0.0
    for r in range(rows):
        for c in range(cols):
            own[0, r, c] = labels[row0 + r, col0 + c] == label
            if whole[r, c]:
                middle_row, middle_col, n = middle_row + r, middle_col + c, n + 1
    middle_row, middle_col = middle_row / max(n, 1.0), middle_col / max(n, 1.0)
    beside, n_up = box_sums(own, BANK_CELLS), 0
    for r in range(rows):
        for c in range(cols):
            if whole[r, c] or beside[0, r, c] == 0 or not count[row0 + r, col0 + c] > 0:
                continue
            level = math.nan
            for k in range(len(NEAREST)):
                i, j = r + NEAREST[k, 0], c + NEAREST[k, 1]
                if 0 <= i < rows and 0 <= j < cols and own[0, i, j] > 0:
                    level = level_m[row0 + i, col0 + j]
                    break
            above = mean[row0 + r, col0 + c] - level
            if above > most_m:
                continue
            kind = UP if above > BANK_M else DOWN if above < -BANK_M else EVEN
            kinds[kind] += 1
            bearing = math.atan2(r - middle_row, c - middle_col) / (2 * math.pi) + 0.5
            sector = min(int(bearing * SECTORS), SECTORS - 1)
            toward[sector, 0] += 1
            toward[sector, 1] += kind == UP
    for sector in range(SECTORS):
        n_up += 2 * toward[sector, 1] > toward[sector, 0]
    return n_up
