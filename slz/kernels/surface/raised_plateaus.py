"""Raised plateaus: flat ground that drops on all sides, as roofs, decks and platforms do.

SLZ thesis, section 2: buildings are the obstacles of a city, and their roofs its flattest ground.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D
from slz.kernels.elementary_functions import F0, F1, median, ramp
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.surface.masks import SIDES, bounding_boxes, box_sums, with_holes
from slz.kernels.surface.surface_record import COUNT, DEEP, MEAN, NUMBERED, SEVERAL, SQUARES, TALL

AROUND = 2  # cells
FEWEST = 30.0  # returns of the neighbourhood
FALSE_SHARE = np.float32(0.01)  # of the returns of a cell, up to which others may be false
SPREAD_M = np.float32(0.06)  # within a cell; more than that of a hard surface on a slope
PENETRATION_PRIOR = np.float32(-4.0)
SCORE_PIERCED, SCORE_SPREAD, SCORE_SEVERAL = np.float32(6.0), np.float32(2.0), np.float32(3.0)
PIERCED, ROUGH, PIERCED_SHARES = np.float32(0.2), np.float32(0.5), np.float32(0.4)
SEVERAL_FROM, SEVERAL_SHARES = np.float32(0.02), np.float32(0.1)
STEP_M = 0.35  # between neighbouring cells of a plateau, for cells of a metre
SMOOTH_M = np.float32(0.35)  # spread of the heights within a cell of a plateau
LEAST_DROP_M = 1.5
REACH_M = 4.0  # beyond the edge, within which the ground is looked for
FLAT_M = 0.5  # between two places at the foot of a wall
SMALLEST_M2, LARGEST_M2 = 8.0, 40_000.0
FEWEST_EDGES = 8
MOST_DROPS = 256
LEAST_SHARE, SHARES = 0.3, 0.6 - 0.3  # of the known edges that drop
SCORE_PRIOR, SCORE_DROPS = -4.0, 8.0


@kernel_part
def spread_m(count: np.float32, squares: np.float32) -> np.float32:
    """Return the standard deviation of the heights within a cell, 0 where nothing was seen."""
    return np.float32(np.sqrt(max(squares, F0) / max(count, F1)))


@kernel
def penetration(fields: Array3D[np.float32]) -> Array2D[np.float32]:
    """Return the log odds for plants: of cells whose neighbourhood has returns from several depths."""
    f, layers = fields.reshape(len(fields), -1), np.zeros_like(fields[:6])
    flat, out = layers.reshape(6, -1), np.full(fields[0].shape, PENETRATION_PRIOR, np.float32)
    for k in range(f.shape[1]):
        count, apart = f[COUNT, k], f[DEEP, k] + f[TALL, k]
        flat[3, k], flat[4, k], flat[5, k] = f[NUMBERED, k], f[SEVERAL, k], count
        if count > F0:
            flat[0, k] = F1
            flat[1, k] = apart >= F1 and apart > FALSE_SHARE * count
            flat[2, k] = spread_m(count, f[SQUARES, k]) > SPREAD_M
    places, pierced, rough, numbered, several, around = box_sums(layers, AROUND).reshape(6, -1)
    for k in range(f.shape[1]):
        if f[COUNT, k] > F0 and around[k] >= FEWEST:
            n = max(places[k], F1)
            score = PENETRATION_PRIOR + SCORE_PIERCED * ramp(pierced[k] / n, PIERCED, PIERCED_SHARES)
            score += SCORE_SPREAD * ramp(rough[k] / n, ROUGH, PIERCED_SHARES)
            if numbered[k] >= FEWEST:
                share = several[k] / max(numbered[k], F1)
                score += SCORE_SEVERAL * ramp(share, SEVERAL_FROM, SEVERAL_SHARES)
            out.flat[k] = score
    return out


@kernel_part
def _root(parent: Array1D[np.int32], i: int) -> int:
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = int(parent[i])
    return i


@kernel_part
def connect(height: Array2D[np.float32], step: float) -> tuple[Array2D[np.int32], int]:
    """Label the cells joined by steps of at most `step`, from 1 on; 0 where the height is NaN.

    Neighbours are the four next cells, and the next but one across a single unknown cell. Return also the
    number of labels.
    """
    rows, cols = height.shape
    parent, out = np.empty(rows * cols, np.int32), np.zeros((rows, cols), np.int32)
    for i in range(rows * cols):
        parent[i] = i
    for r in range(rows):
        for c in range(cols):
            h = height[r, c]
            if np.isnan(h):
                continue
            for dr, dc in ((1, 0), (0, 1)):
                r1, c1 = r + dr, c + dc
                if r1 < rows and c1 < cols and np.isnan(height[r1, c1]):
                    r1, c1 = r1 + dr, c1 + dc
                if r1 < rows and c1 < cols and abs(height[r1, c1] - h) <= step:
                    a, b = _root(parent, r * cols + c), _root(parent, r1 * cols + c1)
                    if a < b:
                        parent[b] = a
                    elif b < a:
                        parent[a] = b
    n = 0
    for r in range(rows):
        for c in range(cols):
            if np.isnan(height[r, c]):
                continue
            i = r * cols + c
            root = _root(parent, i)
            if root == i:
                n += 1
                out[r, c] = n
            else:
                out[r, c] = out[root // cols, root % cols]
    return out, n


@kernel_part
def _keep_possible(labels: Array2D[np.int32], n: int, cell_m2: float) -> int:
    """Keep the labels of plateaus as large as roofs, numbered anew; return their number with label 0."""
    size, number, kept = np.zeros(n + 1, np.int64), np.zeros(n + 1, np.int32), 1
    for k in range(labels.size):
        size[labels.flat[k]] += 1
    for label in range(1, n + 1):
        if SMALLEST_M2 <= size[label] * cell_m2 <= LARGEST_M2:
            number[label] = kept
            kept += 1
    for k in range(labels.size):
        labels.flat[k] = number[labels.flat[k]]
    return kept


@kernel_part
def _holes(labels: Array2D[np.int32], n: int) -> Array2D[np.int32]:
    """Return for each cell within a plateau, but not of it, that plateau; else 0."""
    boxes, holes = bounding_boxes(labels, n, 1), np.zeros_like(labels)
    for label in range(1, n):
        whole, row, col = with_holes(labels, label, boxes[label]), boxes[label, 0], boxes[label, 2]
        for r in range(whole.shape[0]):
            for c in range(whole.shape[1]):
                if whole[r, c] and labels[row + r, col + c] != label:
                    holes[row + r, col + c] = label
    return holes


@kernel_part
def plateau_edges(
    height: Array2D[np.float32], labels: Array2D[np.int32], holes: Array2D[np.int32], n: int, reach: int
) -> tuple[Array2D[np.float32], Array1D[np.int64], Array1D[np.int64]]:
    """Return the drops of each of n labels, and its number of edges to known cells, and of those that drop.

    An edge is a direction along rows or columns in which the next cell is not of the label. What lies there
    is the lowest of the next `reach` cells, so that a parapet or an unseen foot of a wall does not hide a
    drop. Where only the next ones were seen and are as high, what lies there is unknown.
    The cells of `holes` lie within their label, as a pit does: its edge is none. Drops (n, `MOST_DROPS`) are
    the first ones of at least `LEAST_DROP_M`.
    """
    rows, cols = height.shape
    drops, known, down = np.empty((n, MOST_DROPS), np.float32), np.zeros(n, np.int64), np.zeros(n, np.int64)
    for r in range(rows):
        for c in range(cols):
            own = labels[r, c]
            if own == 0:
                continue
            for dr, dc in SIDES:
                r1, c1 = r + dr, c + dc
                if r1 < 0 or c1 < 0 or r1 >= rows or c1 >= cols or labels[r1, c1] == own:
                    continue
                if holes[r1, c1] == own:
                    continue
                lowest, foot, again, farthest = np.inf, np.inf, False, 0
                for k in range(1, reach + 1):
                    r1, c1 = r + k * dr, c + k * dc
                    if r1 < 0 or c1 < 0 or r1 >= rows or c1 >= cols:
                        break
                    if labels[r1, c1] == own:
                        again = True
                        break
                    if not np.isnan(height[r1, c1]):
                        farthest = k
                        if height[r1, c1] < lowest:
                            lowest, foot = height[r1, c1], lowest
                        else:
                            foot = min(foot, height[r1, c1])
                drop = height[r, c] - lowest
                # A parapet, and nothing seen beyond.
                if again or (drop < LEAST_DROP_M and farthest < reach - 1):
                    continue
                known[own] += 1
                if drop >= LEAST_DROP_M:
                    if down[own] < MOST_DROPS:
                        # The foot is uneven: the mean of the two lowest, unless the other is of the wall.
                        apart = foot - lowest
                        drops[own, down[own]] = drop - (apart / 2 if apart < FLAT_M else 0.0)
                    down[own] += 1
    return drops, known, down


@kernel
def raised_plateaus(
    fields: Array3D[np.float32], cell: float
) -> tuple[Array2D[np.float32], Array2D[np.float32]]:
    """Find the plateaus that are raised above all ground around.

    Return (rows, cols) the log odds for a roof, and the height over the ground around, 0 where none is.
    """
    height, smooth = np.full_like(fields[0], np.nan), np.full_like(fields[0], np.nan)
    for k in range(height.size):
        count = fields[COUNT].flat[k]
        if count > 0:
            height.flat[k] = fields[MEAN].flat[k]
            if spread_m(count, fields[SQUARES].flat[k]) < SMOOTH_M:
                smooth.flat[k] = height.flat[k]
    labels, n_all = connect(smooth, STEP_M * cell)
    n = _keep_possible(labels, n_all, cell**2)
    holes = _holes(labels, n)
    drops, known, down = plateau_edges(height, labels, holes, n, max(1, round(REACH_M / cell)))
    score, raised = np.full(n, SCORE_PRIOR, np.float32), np.zeros(n, np.float32)
    for label in range(1, n):
        share = down[label] / max(known[label], 1)
        if known[label] >= FEWEST_EDGES and share > LEAST_SHARE:
            raised[label] = median(drops[label, : min(down[label], MOST_DROPS)])
            score[label] = SCORE_PRIOR + SCORE_DROPS * ramp(share, LEAST_SHARE, SHARES)
    log_odds, raised_m = np.empty_like(height), np.empty_like(height)
    for k in range(labels.size):
        log_odds.flat[k], raised_m.flat[k] = score[labels.flat[k]], raised[labels.flat[k]]
    return log_odds, raised_m
