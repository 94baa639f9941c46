"""Derived maps of a box of cells: slope, relief and certainty of every footprint, from cell statistics."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.kernels.cells.cell_record import HEIGHT, WEIGHT
from slz.kernels.footprint.derive_maps import derive_box
from slz.kernels.footprint.patch import COLS, rows_of_patch
from slz.kernels.footprint.rest_pose import FARTHEST_RING
from slz.kernels.raster.bitmap import ALL, Bits
from slz.kernels.raster.morphology import (
    above,
    closed,
    complement,
    dilated,
    enclosed,
    eroded,
    exceeds,
    minimum_filter,
)
from slz.kernels.simd import LANES
from slz.terrain.gear import Gear, gear_of
from slz.terrain.layers import LAYERS


@dataclass(frozen=True, slots=True)
class Reach:
    """Neighbourhood of a cell that its maps depend on, in cells.

    radius: of a footprint around its cell. gap: radius of the closing that fills gaps which count as seen.
    margin: evidence farther from a cell than this does not affect it. The margin is radius + 4 gap + 3: a
    footprint adds its radius, the closing of seen ground twice the gap, the search for raised cells, which do
    not close gaps, 2 gap + 1 (lowest cell nearby), the rim of seen ground one cell, and the neighbours that
    support extremes one (`summarise`).
    """

    radius: int
    gap: int

    @property
    def margin(self) -> int:
        return self.radius + 4 * self.gap + 3


def reach_of(parameters: Parameters, cell_m: float) -> Reach:
    """Return the neighbourhood for cells of a size."""
    half = parameters.footprint_m / 2 / cell_m
    gap = max(0, round((parameters.coverage_m / cell_m - 1) / 2))
    return Reach(max(1, math.ceil(half - 0.5 - 1e-9)), gap)


@dataclass(frozen=True, slots=True, eq=False)
class CoveredCells:
    """Cell statistics for a box with a margin, and bitmaps: known cells, and its footprints' coverage."""

    cells: NDArray[np.float32]
    known: Bits
    covered: Bits
    unseen: Bits
    edge: int
    radius: int
    cell_m: float
    parameters: Parameters
    gear: Gear

    @classmethod
    def of(
        cls,
        cells: NDArray[np.float32],
        reach: Reach,
        cell_m: float,
        parameters: Parameters,
        refused: NDArray[np.bool_] | None = None,
    ) -> CoveredCells:
        """Compute the bitmaps, see `derive`."""
        known, cols = above(cells[WEIGHT], np.float32(0)), cells.shape[2]
        covered = eroded(closed(known, reach.gap, cols), reach.radius, cols)
        unseen = _unseen(known, cells[HEIGHT], reach, cell_m, parameters)
        if refused is not None:  # what may be water counts as unseen
            unseen |= dilated(above(refused.astype(np.float32), np.float32(0)), reach.radius, cols)
        gear = gear_of(parameters, cell_m)
        return cls(cells, known, covered, unseen, reach.margin, reach.radius, cell_m, parameters, gear)

    @property
    def nearest_unrelated(self) -> int:
        """Distance (cells) from which on a cell's evidence does not affect another of unchanged coverage.

        It is outside the other's footprint and the ground searched by its gear, and supports no extreme
        there, as a neighbour would.
        """
        ground = 0
        if len(self.gear.contacts_m):
            ground = math.ceil(self.gear.reach_m / self.cell_m + 0.5) + FARTHEST_RING
        return max(self.radius, ground) + 1

    @property
    def limits(self) -> tuple[float, float, float, float, float]:
        """Size of a cell, noise of a return, limits of slope (deg) and relief, smallest hazard (m)."""
        p = self.parameters
        return self.cell_m, p.range_noise_m, p.safe_slope_deg, p.relief_m, p.hazard_size_m


def derive(
    cells: NDArray[np.float32],
    reach: Reach,
    cell_m: float,
    parameters: Parameters,
    refused: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Derive the maps of all cells but a margin of `reach.margin` on every side.

    Parameters
    ----------
    cells
        (6, rows, cols) of `slz.kernels.cells.cell_statistics.summarise`.
    refused
        (rows, cols), cells whose surface is refused, such as water; None for none.

    Returns
    -------
    (layers, rows, cols) float32, see `slz.terrain.layers`, and (1, rows, cols) uint8 states.
    """
    seen, m = CoveredCells.of(cells, reach, cell_m, parameters, refused), reach.margin
    rows, cols = cells.shape[1] - 2 * m, cells.shape[2] - 2 * m
    wide = -(-cols // LANES) * LANES
    maps, states = np.empty((len(LAYERS), rows, wide), np.float32), np.empty((1, rows, wide), np.uint8)
    levels = np.empty((-(-rows // rows_of_patch(reach.radius)), -(-wide // COLS)), np.float32)
    every = np.full((rows + 2 * m, (wide + 2 * m + 63) >> 6), ALL)
    derive_box(
        cells, seen.covered, seen.unseen, m, seen.radius, seen.limits,
        seen.gear.contacts_m, seen.gear.limits, (0, rows, 0, wide),
        maps.ravel(), 0, rows * wide, wide, states.ravel(), 0, every, levels,
    )  # fmt: skip
    return maps[:, :, :cols], states[:, :, :cols]


def seen_ground(
    known: Bits, height_m: NDArray[np.float32], reach: Reach, cell_m: float, p: Parameters
) -> Bits:
    """Return the cells that count as seen: those with returns, and narrow gaps between them.

    An object amid unseen ground must not make that ground count as seen. So cells raised above nearby ground
    close no gap, unless a safe slope leads up to them; a single cell among eight seen ones counts as seen
    beside any. Cells depend on others up to 4 gap + 2 away.
    """
    rise_m = math.tan(math.radians(p.safe_slope_deg)) * cell_m / math.sqrt(2)
    lowest, cols = minimum_filter(height_m, 2 * reach.gap + 1, rise_m), height_m.shape[1]
    level = known & ~exceeds(height_m, lowest, p.relief_m)
    return known | closed(level, reach.gap, cols) | enclosed(known, cols)


def _unseen(known: Bits, height_m: NDArray[np.float32], reach: Reach, cell_m: float, p: Parameters) -> Bits:
    """Return the footprints that hold unseen ground.

    The outermost seen cells may be part water, part shore, so the rim does not count as seen.
    """
    cols = height_m.shape[1]
    return dilated(complement(seen_ground(known, height_m, reach, cell_m, p), cols), reach.radius + 1, cols)
