"""Footing of the gear around a point: safe headings, and how likely a hazard there went unseen."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.kernels.cells.cell_record import BOTTOM, EXCESS, HEIGHT, SPREAD, TOP, WEIGHT
from slz.kernels.footprint.certainty import hazard_quarters
from slz.kernels.footprint.rest_pose import keep_common_headings
from slz.terrain.gear import HEADING_STEP_DEG, gear_of

ALL_HEADINGS = tuple(range(0, 360, HEADING_STEP_DEG))


@dataclass(frozen=True, slots=True)
class Footing:
    """Ground for the gear around a point.

    headings_deg: compass headings at which the gear stands on every cell within the touchdown error.
    unseen: probability that a hazard of `hazard_size_m` within a footprint there got no return; NaN where
    unknown.
    """

    headings_deg: tuple[int, ...] = ALL_HEADINGS
    unseen: float = math.nan


ANY_FOOTING = Footing()


def footing(
    cells: NDArray[np.float32], rows: int, cols: int, radius: int, cell_m: float, parameters: Parameters
) -> Footing:
    """Return the footing on a box of rows x cols cells.

    Parameters
    ----------
    cells
        (6, rows + 2 radius, cols + 2 radius) of `slz.kernels.cells.cell_statistics.summarise`.
    """
    known = cells[WEIGHT] > 0
    side = 2 * radius + 1
    share = np.lib.stride_tricks.sliding_window_view(known, (side, side)).mean(axis=(2, 3)).min()
    unseen = float((1 - share) ** (hazard_quarters(cell_m, parameters.hazard_size_m) / 4))
    gear = gear_of(parameters, cell_m)
    if parameters.gear == "none" or not known.any():
        return Footing(unseen=unseen)
    level = np.median(cells[HEIGHT][known])
    lower = np.where(known, cells[BOTTOM] - level + cells[EXCESS], np.inf).astype(np.float32)
    upper = np.where(known, cells[TOP] - level - cells[EXCESS], -np.inf).astype(np.float32)
    middle = np.where(known, cells[HEIGHT] - level, 0).astype(np.float32)
    noise_m = math.sqrt(float(cells[SPREAD][known].mean()))
    fits = np.ones(len(gear.contacts_m), np.bool_)
    ground = lower.ravel(), middle.ravel(), upper.ravel(), known.shape[1], radius, radius
    keep_common_headings(ground, radius, rows, cols, cell_m, gear.contacts_m, gear.limits, noise_m, fits)
    around = np.tile(fits, 360 // gear.period_deg)
    return Footing(tuple((np.flatnonzero(around) * HEADING_STEP_DEG).tolist()), unseen)
