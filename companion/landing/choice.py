"""Which zone to land in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz import Report, Zone

ENOUGH_CLEARANCE_M = 8.0
METRES_OF_CLEARANCE_PER_METRE_OF_WAY = 0.04


def choose(
    report: Report,
    position_enu_m: NDArray[np.float64],
    refused_enu_m: Sequence[NDArray[np.float64]],
    parameters: Parameters,
    refuse_within_m: float = 6.0,
) -> Zone | None:
    """Return the zone to land in, or None when none will do.

    Only zones whose best point is certain enough and not near a point refused before count. Clearance
    wins up to what a vehicle can use, and is weighed against the way there.
    """

    def merit(zone: Zone) -> float:
        way = float(np.hypot(*(zone.best.enu_m[:2] - position_enu_m[:2])))
        return min(zone.best.clearance_m, ENOUGH_CLEARANCE_M) - METRES_OF_CLEARANCE_PER_METRE_OF_WAY * way

    def usable(zone: Zone) -> bool:
        far = all(np.hypot(*(zone.best.enu_m[:2] - point[:2])) > refuse_within_m for point in refused_enu_m)
        return (
            far
            and zone.best.certainty >= parameters.min_certainty
            and bool(np.isfinite(zone.best.enu_m).all())
        )

    return max((zone for zone in report.zones if usable(zone)), key=merit, default=None)
