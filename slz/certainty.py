"""Certainty: the probability that the whole footprint at a cell is safe.

The numbers were found on surveys that the simulator flew (`slz reproduce` draws the reliability diagram): of
cells told 0.9, nine of ten or more are safe.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from params import Parameters

Floats = NDArray[np.float32]

SLOPE_MARGIN_DEG = 0.06  # how much steeper ground is than its fitted plane, and how much that varies
RELIEF_NOISE = 1.3  # standard deviations of one return that the noise adds to a relief beyond its excess,
RELIEF_SPREAD = 0.6  # and how much that varies
HIDDEN = 0.01  # share of footprints nearly all gaps in which these hide a hazard; of half gaps a sixteenth
RIM = 0.15  # share of hazards in the outermost cells of a footprint alone that truly reach into it


def certainty(
    slope_deg: Floats,
    slope_sigma_deg: Floats,
    relief_m: Floats,
    inner_relief_m: Floats,
    noise_m: Floats,
    share_seen: Floats,
    parameters: Parameters,
) -> Floats:
    """Return the probability that slope and relief of footprints are within their limits; 0 where unknown.

    Parameters
    ----------
    slope_deg, slope_sigma_deg
        Slope of the footprint's plane and its standard error.
    relief_m, inner_relief_m
        Relief of all of the footprint, and without its outermost cells; NaN where the slope is too steep.
    noise_m
        Standard deviation of the height of one return.
    share_seen
        Share of the footprint's cells that hold a return; gaps may hide a hazard.
    """
    p = parameters
    spread_deg = np.hypot(slope_sigma_deg, np.float32(SLOPE_MARGIN_DEG))
    gentle = special.ndtr((p.safe_slope_deg - SLOPE_MARGIN_DEG - slope_deg) / spread_deg)
    noise_m = np.maximum(noise_m, np.float32(1e-3))

    def even(relief: Floats) -> Floats:
        return np.asarray(special.ndtr(((p.relief_m - relief) / noise_m + RELIEF_NOISE) / RELIEF_SPREAD))

    out = gentle * (RIM * even(relief_m) + (1 - RIM) * even(inner_relief_m))
    out *= 1 - HIDDEN * (1 - share_seen) ** 4
    return np.nan_to_num(np.asarray(out, np.float32))
