"""Raised plateaus: flat ground that drops on all sides, as roofs, decks and platforms do.

SLZ thesis, section 2: buildings are the obstacles of a city, and their roofs its flattest ground.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.kernels.surface.masks import filled
from slz.kernels.surface.plateaus import connect, edges
from slz.surface.surface_cells import Floats, SurfaceCells, with_margin

STEP_M = 0.35  # between neighbouring cells of a plateau, for cells of a metre
SMOOTH_M = 0.35  # spread of the heights within a cell of a plateau
LEAST_DROP_M = 1.5
REACH_M = 4.0  # beyond the edge, within which the ground is looked for
SMALLEST_M2, LARGEST_M2 = 8.0, 40_000.0
FEWEST_EDGES = 8
MOST_DROPS = 256
SHARE = 0.6  # of the known edges that drop
SCORE_PRIOR, SCORE_DROPS = -4.0, 8.0


@dataclass(frozen=True, slots=True)
class RaisedPlateaus:
    """log_odds: (rows, cols), for a roof. raised_m: (rows, cols), over the ground around, 0 where none is."""

    log_odds: Floats
    raised_m: Floats


def raised_plateaus(cells: SurfaceCells) -> RaisedPlateaus:
    """Find the plateaus that are raised above all ground around."""
    height = np.where(cells.seen & (cells.spread_m < SMOOTH_M), cells.mean_m, np.float32(np.nan))
    height = np.ascontiguousarray(height, np.float32)
    labels = np.zeros(cells.shape, np.int32)
    n = connect(height, STEP_M * cells.cell_m, labels)
    drops, held = np.empty((n + 1, MOST_DROPS), np.float32), np.zeros(n + 1, np.int64)
    reach = max(1, round(REACH_M / cells.cell_m))
    everything = np.where(cells.seen, cells.mean_m, np.float32(np.nan)).astype(np.float32)
    size = np.bincount(labels.ravel(), minlength=n + 1) * cells.cell_m**2
    possible = (size >= SMALLEST_M2) & (size <= LARGEST_M2)
    possible[0] = False
    holes = _holes(labels, possible)
    known, down = edges(everything, labels, holes, n, LEAST_DROP_M, reach, drops, held)
    with np.errstate(invalid="ignore"):
        share = down / np.maximum(known, 1)
    found = possible & (known >= FEWEST_EDGES) & (share > 0.3)
    score, raised = np.full(n + 1, SCORE_PRIOR), np.zeros(n + 1)
    for label in np.flatnonzero(found).tolist():
        raised[label] = np.median(drops[label, : held[label]])
        score[label] += SCORE_DROPS * float(np.clip((share[label] - 0.3) / (SHARE - 0.3), 0, 1))
    return RaisedPlateaus(_on(labels, score), _on(labels, raised))


def _holes(labels: NDArray[np.int32], possible: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return for each cell within one of the possible plateaus, but not of it, that plateau; else 0."""
    number = np.zeros(len(possible), np.int32)
    number[possible] = np.arange(1, np.count_nonzero(possible) + 1)
    back, own = np.concatenate([[0], np.flatnonzero(possible)]), number[labels]
    holes = np.zeros(labels.shape, np.int32)
    for label, box in with_margin(own, len(back), 1):
        mine = own[box] == label
        holes[box][filled(mine) & ~mine] = back[label]
    return holes


def _on(labels: NDArray[np.int32], values: NDArray[np.float64]) -> Floats:
    return np.asarray(values[labels], np.float32)
