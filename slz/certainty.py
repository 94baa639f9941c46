"""Certainty: the probability that the whole footprint at a cell is safe."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from params import Parameters

Floats = NDArray[np.float32]


def certainty(
    slope_deg: Floats,
    slope_sigma_deg: Floats,
    relief_m: Floats,
    noise_m: Floats,
    unseen: NDArray[np.bool_],
    parameters: Parameters,
) -> Floats:
    """Return the probability that slope and relief of footprints are within their limits; 0 where unknown."""
    p = parameters
    steep = (np.float32(p.safe_slope_deg) - slope_deg) / np.maximum(slope_sigma_deg, np.float32(1e-3))
    rough = (np.float32(p.relief_m) - relief_m) / np.maximum(np.sqrt(2) * noise_m, np.float32(1e-3))
    out = special.ndtr(steep) * special.ndtr(rough)
    out[unseen | np.isnan(out)] = 0
    return np.asarray(out, np.float32)
