"""The maps of a rectangle of cells from their evidence: slope, relief and certainty of every footprint."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from params import Parameters
from slz.certainty import certainty
from slz.kernels.footprint import HEIGHT, TOP, WEIGHT, closed, highest_around, planes
from slz.maps import SAFE, UNKNOWN, UNSAFE

SIGMAS = 3.0  # standard errors that the slope keeps from its limit
LAYERS = ("height_m", "top_m", "slope_deg", "slope_sigma_deg", "relief_m", "roughness", "certainty")
VERDICT_SAFE, VERDICT_UNSAFE, VERDICT_UNKNOWN = (np.uint8(i) for i in (1, 2, 3))  # 0: nothing was drawn
VERDICT_STATE = np.array([UNKNOWN, SAFE, UNSAFE, UNKNOWN], np.uint8)


@dataclass(frozen=True, slots=True)
class Reach:
    """How far evidence reaches, in cells.

    radius: of a footprint about its cell. gap: of the closing that fills gaps which count as seen. margin:
    evidence farther than this from a cell says nothing of it. A footprint reaches by its radius. Whether a
    cell of it is seen depends on a closing of seen ground (twice the gap), of which the raised cells are
    taken out, found by the lowest cell within 2 gap + 1; one more cell for the rim of seen ground, one for
    the company of extremes (`summarise`). So the margin is radius + 4 gap + 3.
    """

    radius: int
    gap: int

    @property
    def margin(self) -> int:
        return self.radius + 4 * self.gap + 3


def reach_of(parameters: Parameters, cell_m: float) -> Reach:
    """Return how far evidence reaches with cells of a size."""
    half = parameters.footprint_m / 2 / cell_m
    gap = max(0, round((parameters.coverage_m / cell_m - 1) / 2))
    return Reach(max(1, math.ceil(half - 0.5 - 1e-9)), gap)


def drawn(
    cells: NDArray[np.float32], reach: Reach, cell_m: float, parameters: Parameters
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Draw the maps of all cells but a margin of `reach.margin` on every side.

    Parameters
    ----------
    cells
        (6, rows, cols) of `slz.kernels.footprint.summarise`.

    Returns
    -------
    (7, rows, cols) float32 `LAYERS`, NaN where unknown, and (rows, cols) uint8 verdicts, see `VERDICT_STATE`.
    """
    p, m = parameters, reach.margin
    known = cells[WEIGHT] > 0
    covered = closed(known.astype(np.uint8), reach.gap)
    fits = planes(cells, covered, reach.radius, cell_m, p.range_noise_m, p.safe_slope_deg, p.relief_m)
    unseen = _unseen(known, cells[HEIGHT], reach, cell_m, p)
    inner = slice(m, cells.shape[1] - m), slice(m, cells.shape[2] - m)
    slope, sigma, relief, rms, noise, inside = (fit[inner] for fit in fits)
    gentle = slope + SIGMAS * sigma < np.float32(p.safe_slope_deg)
    even = gentle & (relief < np.float32(p.relief_m))
    safe = even & ~unseen[inner]
    unknown = np.isnan(slope) | (even & ~safe)
    for fit in (slope, sigma, relief, rms, noise, inside):
        fit[unknown] = np.nan
    sure = certainty(slope, sigma, relief, inside, noise, _share(known, reach)[inner], p)
    sure[unseen[inner]] = 0
    values = np.stack((cells[HEIGHT][inner], cells[TOP][inner], slope, sigma, relief, rms, sure))
    return values, np.where(safe, VERDICT_SAFE, np.where(unknown, VERDICT_UNKNOWN, VERDICT_UNSAFE))


def _share(known: NDArray[np.bool_], reach: Reach) -> NDArray[np.float32]:
    """Return the share of each footprint's cells that hold a return."""
    return np.asarray(ndimage.uniform_filter(known.astype(np.float32), 2 * reach.radius + 1))


def _unseen(
    known: NDArray[np.bool_], height_m: NDArray[np.float32], reach: Reach, cell_m: float, p: Parameters
) -> NDArray[np.bool_]:
    """Tell which footprints hold unseen ground.

    What stands in the middle of unseen ground must not make that ground seen: cells above ground near
    enough for a gap between to count as seen close no gap, unless a safe slope leads up to them. And the
    outermost seen cells may be part water, part shore.
    """
    rise_m = math.tan(math.radians(p.safe_slope_deg)) * cell_m / math.sqrt(2)
    lowest = -highest_around(-height_m, 2 * reach.gap + 1, rise_m)
    raised = height_m - lowest > np.float32(p.relief_m)
    seen = known | (closed((known & ~raised).astype(np.uint8), reach.gap) == 1)
    whole = ndimage.binary_erosion(seen, np.ones((3, 3), bool), border_value=1)
    return np.asarray(highest_around((~whole).astype(np.float32), reach.radius, 0) > 0)
