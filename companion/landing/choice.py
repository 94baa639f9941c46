"""Which zone to land in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz import Report, Zone


def choose(
    report: Report,
    refused_enu_m: Sequence[NDArray[np.float64]],
    parameters: Parameters,
    refuse_within_m: float = 6.0,
) -> Zone | None:
    """Return the best ranked zone that will do, or None.

    Its best point must be certain enough, and not near a point refused before.
    """

    def usable(zone: Zone) -> bool:
        far = all(np.hypot(*(zone.best.enu_m[:2] - point[:2])) > refuse_within_m for point in refused_enu_m)
        return (
            far
            and zone.best.certainty >= parameters.min_certainty
            and bool(np.isfinite(zone.best.enu_m).all())
        )

    return next(filter(usable, report.zones), None)
