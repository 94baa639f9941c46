"""Made corridors of a point, for tests of the ways that are flown."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from slz import SAFE, Corridors
from slz.landing_point.corridors import BEARINGS, STEP_DEG

SLOPES_DEG = (10.0, 30.0, 60.0, 90.0)


def made(states: Mapping[tuple[int, float], int] | None = None, *, all_of: int = int(SAFE)) -> Corridors:
    """Return the corridors of the origin: one state for all but those of a bearing and slope (degrees)."""
    filled = np.full((BEARINGS, len(SLOPES_DEG)), all_of, np.uint8)
    for (bearing_deg, slope_deg), state in (states or {}).items():
        filled[bearing_deg // STEP_DEG, SLOPES_DEG.index(slope_deg)] = state
    nowhere = np.full((BEARINGS, 3), np.nan)
    return Corridors(np.zeros(3), SLOPES_DEG, filled, np.zeros(BEARINGS), nowhere)
