"""Extents of one level with banks: still water is level to centimetres; a river falls evenly.

Water in airborne LiDAR by geometry alone, without a trained classifier: arXiv 2301.06567. Tarmac and pitches
drain by 0.5 to 2 %, so their level changes within metres, and they go on without a bank.
"""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D
from slz.kernels.array_memory import put
from slz.kernels.elementary_functions import interpolate
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.surface.banks import banks
from slz.kernels.surface.masks import bounding_boxes, closed_mask, connected_parts
from slz.kernels.surface.shores import grow_extents
from slz.kernels.surface.smooth_planes import PLANE_RADIUS
from slz.kernels.surface.surface_record import COUNT, GRADIENT, LEVEL, MEAN, RESIDUAL, SQUARES, N

BLOCK_M = 16.0  # side of the blocks in which an extent that falls is a plane
FEW = 0.2  # cells2 added to the spread of a block: one of few cells has no gradient
FLATTEST, RESIDUAL_M = np.float32(0.01), np.float32(0.06)  # of a plane over five cells, even with ripples
ROUGHEST_M, SIGMAS = np.float32(0.2), 2.5  # of planes over ten cells, with waves; how far a shore may be off
SMALLEST_M2 = 40.0  # extent of level planes, that is without a margin of two cells
BAND_M = 0.06  # a cell at the shore belongs to the water if its mean is so near the level
EXACT_M, EXACT_FALL_M = (0.006, 0.03), (0.006, 0.012)  # standard deviation of water, of ground; about a fall
EXACTNESS = 1.0, -1.0
FALLING_M = 0.018  # standard deviation of a level from which the extent may fall
# Logarithms of 40, 100, 400, 10,000, 40,000 m2: nothing but water is level over so much.
EXTENTS = tuple(np.log([40.0, 100.0, 400.0, 10_000.0, 40_000.0]).tolist())
SCORE_EXTENTS = -2.0, 0.0, 1.5, 1.5, 3.0  # log odds
SCORE_FALLING = 1.5  # at most, of an extent that falls
FALLS, SCORES_FALL = (0.003, 0.006), (0.0, -3.0)
SCORE_POOR = 1.5


@kernel_part
def even_falls(
    labels: Array2D[np.int32], height: Array2D[np.float32], falling: Array1D[np.bool_], cell: float
) -> tuple[Array2D[np.float64], Array1D[np.float64], Array1D[np.float64]]:
    """Fit planes to the blocks of extents that may fall.

    Return (rows, cols) the height above them, and of each label its variance, and the mean gradient.

    Parameters
    ----------
    labels, falling
        (rows, cols) of the extents, 0 for none, and whether each label is one that may fall.
    """
    n, side, off, steep = len(falling), int(BLOCK_M / cell), np.zeros(labels.shape), np.zeros(labels.shape)
    size, variance, gradient = np.zeros(n), np.zeros(n), np.zeros(n)
    any_falls = False
    for label in range(1, n):
        any_falls |= falling[label]
    if not any_falls:
        return off, variance, gradient
    boxes = bounding_boxes(labels, n, 0)
    for label in range(1, n):
        if falling[label]:
            box = boxes[label]
            for row in range(box[0] // side * side, box[1] + 1, side):
                for col in range(box[2] // side * side, box[3] + 1, side):
                    _fit(labels, height, label, row, col, side, cell, off, steep)
    for k in range(labels.size):
        own = labels.flat[k]
        if falling[own]:
            size[own] += 1
            variance[own] += off.flat[k] * off.flat[k]
            gradient[own] += steep.flat[k]
    for label in range(1, n):
        if size[label] > 0:
            variance[label], gradient[label] = variance[label] / size[label], gradient[label] / size[label]
    return off, variance, gradient


@kernel_part
def _fit(
    labels: Array2D[np.int32],
    height: Array2D[np.float32],
    label: int,
    row: int,
    col: int,
    side: int,
    cell: float,
    off: Array2D[np.float64],
    steep: Array2D[np.float64],
) -> None:
    """Write heights above the plane through a label's cells in the block from a cell on, and its gradient."""
    n = mx = my = mz = xx = yy = xy = xz = yz = 0.0
    end_row, end_col = min(row + side, labels.shape[0]), min(col + side, labels.shape[1])
    for r in range(row, end_row):
        for c in range(col, end_col):
            if labels[r, c] == label:
                n, mx, my, mz = n + 1, mx + cell * c, my + cell * r, mz + height[r, c]
    if n == 0:
        return
    mx, my, mz = mx / n, my / n, mz / n
    for r in range(row, end_row):
        for c in range(col, end_col):
            if labels[r, c] == label:
                x, y, z = cell * c - mx, cell * r - my, height[r, c] - mz
                xx, yy, xy, xz, yz = xx + x * x, yy + y * y, xy + x * y, xz + x * z, yz + y * z
    xx, yy, xy, xz, yz = xx / n + FEW * cell**2, yy / n + FEW * cell**2, xy / n, xz / n, yz / n
    determinant = xx * yy - xy * xy
    a, b = (xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant
    for r in range(row, end_row):
        for c in range(col, end_col):
            if labels[r, c] == label:
                x, y, z = cell * c - mx, cell * r - my, height[r, c] - mz
                off[r, c] = z - a * x - b * y
                steep[r, c] = math.hypot(a, b)


@kernel_part
def _bands(residual_m: Array1D[np.float64]) -> Array1D[np.float64]:
    """Return for each extent how far from its level a cell of it may be."""
    out = np.empty(len(residual_m))
    for label in range(len(out)):
        out[label] = max(BAND_M, SIGMAS * residual_m[label])
    return out


@kernel
def add_coarse(
    fields: Array3D[np.float32],
    labels: Array2D[np.int32],
    level_m: Array2D[np.float32],
    score: Array1D[np.float64],
    wide: Array2D[np.int32],
    wide_m: Array2D[np.float32],
    scores: Array1D[np.float64],
    residual_m: Array1D[np.float64],
) -> Array1D[np.float64]:
    """Add extents found in cells twice as wide to labels and levels, where they say more of water.

    They find rippled or sparsely hit water. Return the log odds for water of each label.

    Parameters
    ----------
    labels, level_m, score
        Of `extents_of` for the cells; changed.
    wide, wide_m, scores, residual_m
        Of `extents_of` for the wide ones.
    """
    n, band_m, both = len(score), _bands(residual_m), np.empty(len(score) + len(scores) - 1)
    for r in range(labels.shape[0]):
        for c in range(labels.shape[1]):
            own, height = wide[r // 2, c // 2], wide_m[r // 2, c // 2]
            near = fields[COUNT, r, c] == 0 or abs(fields[MEAN, r, c] - height) < band_m[own]
            if own > 0 and near and (labels[r, c] == 0 or scores[own] > score[labels[r, c]]):
                labels[r, c], level_m[r, c] = own + n - 1, height
    put(both, 0, score)
    put(both, n, scores[1:])
    return both


@kernel
def coarser(fields: Array3D[np.float32]) -> Array3D[np.float32]:
    """Return number, mean and squared deviations of returns in cells twice as wide, (3, rows, cols)."""
    _, rows, cols = fields.shape
    out = np.zeros((3, (rows + 1) // 2, (cols + 1) // 2), np.float32)
    for r in range(out.shape[1]):
        for c in range(out.shape[2]):
            total = middle = squares = 0.0
            for i in range(2 * r, min(2 * r + 2, rows)):
                n, heights = 0.0, 0.0
                for j in range(2 * c, min(2 * c + 2, cols)):
                    n += fields[COUNT, i, j]
                    heights += np.float64(fields[COUNT, i, j]) * fields[MEAN, i, j]
                total, middle = total + n, middle + heights
            middle /= max(total, 1.0)
            for i in range(2 * r, min(2 * r + 2, rows)):
                within = 0.0
                for j in range(2 * c, min(2 * c + 2, cols)):
                    off = fields[MEAN, i, j] - middle
                    within += fields[SQUARES, i, j] + fields[COUNT, i, j] * (off * off)
                squares += within
            out[0, r, c], out[1, r, c], out[2, r, c] = total, middle, squares
    return out


@kernel_part
def _grow_to_shore(
    count: Array2D[np.float32],
    mean: Array2D[np.float32],
    labels: Array2D[np.int32],
    level_m: Array2D[np.float32],
    band_m: Array1D[np.float64],
) -> None:
    """Grow extents over the margin that the planes leave, up to cells that rise from their level.

    Unseen cells belong to them as far as they are gaps within.
    """
    grow_extents(count, mean, labels, level_m, band_m, PLANE_RADIUS + 1)
    own, unseen, any_unseen = np.zeros(labels.shape, np.bool_), np.zeros(labels.shape, np.bool_), False
    for k in range(labels.size):
        if labels.flat[k] > 0:
            own.flat[k], unseen.flat[k] = count.flat[k] > 0, count.flat[k] == 0
            any_unseen |= count.flat[k] == 0
    if any_unseen:
        gaps = closed_mask(own, unseen)
        for k in range(labels.size):
            if unseen.flat[k] and not gaps.flat[k]:
                labels.flat[k], level_m.flat[k] = 0, np.nan


@kernel
def extents_of(
    count: Array2D[np.float32],
    mean: Array2D[np.float32],
    planes: Array3D[np.float32],
    cell: float,
    most_residual_m: np.float32,
    falling_m: float,
) -> tuple[Array2D[np.int32], Array2D[np.float32], Array1D[np.float64], Array1D[np.float64]]:
    """Find the extents of one level in cells of one size; those less exact than `falling_m` may fall.

    Return labels (rows, cols), 0 for none, the level there, if it is water, else NaN, and of each label the
    log odds for water and the residual of its planes, root mean square.
    """
    (rows, cols), height = mean.shape, planes[LEVEL]
    core, level_m = np.empty((rows, cols), np.bool_), np.full((rows, cols), np.nan, np.float32)
    for r in range(rows):
        for c in range(cols):
            core[r, c] = (planes[GRADIENT, r, c] < FLATTEST) & (planes[RESIDUAL, r, c] < most_residual_m)
    labels, n = connected_parts(core, cell**2, SMALLEST_M2)
    score, residual_m = np.zeros(n), np.zeros(n)
    if n == 1:
        return labels, level_m, score, residual_m
    size, level, noise_m2, variance, exact = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    inexact_m, falling = np.zeros(n), np.zeros(n, np.bool_)
    for r in range(rows):
        for c in range(cols):
            own, residual = labels[r, c], np.float64(planes[RESIDUAL, r, c])
            if own > 0:
                size[own] += 1
                level[own] += height[r, c]
                noise_m2[own] += residual * residual / planes[N, r, c]
                residual_m[own] += residual * residual
    for label in range(1, n):
        level[label], noise_m2[label] = level[label] / size[label], noise_m2[label] / size[label]
        residual_m[label] = math.sqrt(residual_m[label] / size[label])
    for r in range(rows):
        for c in range(cols):
            own = labels[r, c]
            if own > 0:
                off = height[r, c] - level[own]
                variance[own] += off * off
                level_m[r, c] = level[own]
    for label in range(1, n):
        inexact_m[label] = math.sqrt(max(variance[label] / size[label] - noise_m2[label], 0.0))
        falling[label] = inexact_m[label] > falling_m
    above, about, falls = even_falls(labels, height, falling, cell)
    for label in range(1, n):
        falling[label] &= falls[label] < FALLS[-1]
    for r in range(rows):
        for c in range(cols):
            if falling[labels[r, c]]:
                level_m[r, c] = height[r, c] - above[r, c]
    for label in range(1, n):
        exact[label] = interpolate(inexact_m[label], EXACT_M, EXACTNESS)
        area = interpolate(math.log(size[label] * cell**2), EXTENTS, SCORE_EXTENTS)
        if falling[label]:
            about_m = math.sqrt(max(0.0, about[label] - noise_m2[label]))
            exact[label] = interpolate(about_m, EXACT_FALL_M, EXACTNESS)
            area, score[label] = min(area, SCORE_FALLING), interpolate(falls[label], FALLS, SCORES_FALL)
        score[label] += min(area, 0.0) + max(area, 0.0) * exact[label] - SCORE_POOR * max(-exact[label], 0.0)
    _grow_to_shore(count, mean, labels, level_m, _bands(residual_m))
    around = banks(count, mean, labels, level_m, falling, cell)
    for label in range(1, n):
        weight = max(exact[label], 0.0) if falling[label] and around[label] > 0 else 1.0
        score[label] += around[label] * weight
    return labels, level_m, score, residual_m
