"""Footing around a point: safe headings, why others are not, and how likely a hazard there went unseen."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.kernels.cells.cell_record import BOTTOM, EXCESS, HEIGHT, SPREAD, WEIGHT
from slz.kernels.footprint.certainty import hazard_quarters
from slz.kernels.footprint.rest_planes import CORNERS, highest_floors, keep_rests, rests_anyhow
from slz.terrain.discs import Site, discs_of, keep_clear_headings, upper_ground
from slz.terrain.gear import HEADING_ERROR_DEG, HEADING_STEP_DEG, gear_of

YAW_ERROR = math.radians(HEADING_ERROR_DEG)
ALL_HEADINGS = tuple(range(0, 360, HEADING_STEP_DEG))
GEAR = "gear: tips or touches with its belly"


@dataclass(frozen=True, slots=True)
class Footing:
    """Ground for the gear, and room for rotor and tail, around a point.

    headings_deg: compass headings at which the gear stands, and rotor and tail are clear, on every cell
    within the touchdown error. unseen: probability that a hazard of `hazard_size_m` within a footprint there
    got no return; NaN where unknown. blocked_by: what excludes other headings, in words; "" where none is.
    """

    headings_deg: tuple[int, ...] = ALL_HEADINGS
    unseen: float = math.nan
    blocked_by: str = ""

    @property
    def is_judged(self) -> bool:
        """True if a map with evidence of cells judged it."""
        return not math.isnan(self.unseen)


ANY_FOOTING = Footing()


def judges_headings(parameters: Parameters) -> bool:
    """Return whether gear, rotor or tail may exclude headings."""
    p = parameters
    return p.mode == "default" and bool(p.gear != "none" or p.rotor_diameter_m or p.tail_length_m)


def footing_edge(radius: int, cell_m: float, parameters: Parameters) -> int:
    """Return how many cells around those of the touchdown a footing depends on: a footprint's or more."""
    discs = discs_of(parameters, cell_m)
    edge = max(radius, math.ceil(gear_of(parameters, cell_m).reach_m / cell_m + 1))
    return edge if discs is None else max(edge, discs.reach + discs.margin)


def footing(
    cells: NDArray[np.float32], rows: int, cols: int, radius: int, cell_m: float, parameters: Parameters
) -> Footing:
    """Return the footing on a box of rows x cols cells.

    Parameters
    ----------
    cells
        (6, rows + 2 edge, cols + 2 edge) of `slz.kernels.cells.cell_statistics.summarise`; the edge is
        `footing_edge`.
    radius
        Radius of a footprint, in cells.
    """
    edge, discs = footing_edge(radius, cell_m, parameters), discs_of(parameters, cell_m)
    beyond = edge - radius
    inner = cells[:, beyond : cells.shape[1] - beyond, beyond : cells.shape[2] - beyond]
    known = inner[WEIGHT] > 0
    side = 2 * radius + 1
    share = np.lib.stride_tricks.sliding_window_view(known, (side, side)).mean(axis=(2, 3)).min()
    unseen = float((1 - share) ** (hazard_quarters(cell_m, parameters.hazard_size_m) / 4))
    gear = gear_of(parameters, cell_m)
    if (parameters.gear == "none" and discs is None) or not known.any():
        return Footing(unseen=unseen)
    level = float(np.median(inner[HEIGHT][known]))
    noise_m = math.sqrt(float(inner[SPREAD][known].mean()))
    ground = *_ground(cells, level), cells.shape[2], edge, edge
    site = Site(cells, ground, rows, cols, edge, radius, cell_m)
    corners = np.empty((0, 2 * CORNERS)) if discs is None else discs.corners_m
    floors = np.empty((rows * cols, len(corners), CORNERS))
    steepest, blocked_by = np.empty(floors.shape[:2]), ""
    clear = np.zeros(len(ALL_HEADINGS), np.bool_)
    box = ground, radius, rows, cols, cell_m
    if len(gear.contacts_m) and rests_anyhow(*box, gear.limits, corners, floors, steepest):
        clear[:] = True
        if discs is not None:
            keep_clear_headings(discs, site, parameters, floors, steepest, clear)
    others = ~clear
    in_the_way = None
    if discs is not None and len(gear.contacts_m) and others.any():
        # The search for rest planes takes most of the time: not where the highest of all would not do.
        highest = np.empty_like(floors)
        highest_floors(*box, gear.limits, corners, highest)
        in_the_way = keep_clear_headings(discs, site, parameters, highest, np.zeros_like(steepest), others)
    if others.any():
        keep_rests(*box, gear.contacts_m, gear.limits, noise_m, YAW_ERROR, others, corners, floors, steepest)
        if discs is not None and others.any():
            in_the_way = keep_clear_headings(discs, site, parameters, floors, steepest, others) or in_the_way
    if in_the_way is not None:
        blocked_by = in_the_way.text
    elif not (clear | others).all():
        blocked_by = GEAR
    headings = np.flatnonzero(clear | others) * HEADING_STEP_DEG
    return Footing(tuple(headings.tolist()), unseen, blocked_by)


def _ground(
    cells: NDArray[np.float32], level: float
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return lowest, mean and highest ground over a level, flat; +inf, 0 and -inf where unknown."""
    known = cells[WEIGHT] > 0
    lower = np.where(known, cells[BOTTOM] - level + cells[EXCESS], np.inf).astype(np.float32)
    middle = np.where(known, cells[HEIGHT] - level, 0).astype(np.float32)
    return lower.ravel(), middle.ravel(), upper_ground(cells, level).ravel()
