"""Which zone to land in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from companion.landing.situation import Vector
from params import Parameters
from slz import Report, Zone

REFUSE_WITHIN_M = 6.0


def choose(zones: Sequence[Zone], refused_enu_m: Sequence[Vector], parameters: Parameters) -> Zone | None:
    """Return the best ranked zone that will do, or None.

    Its best point must be certain enough, and not near a point refused before.
    """
    return next((zone for zone in zones if _usable(zone, refused_enu_m, parameters)), None)


def soonest(
    report: Report, refused_enu_m: Sequence[Vector], parameters: Parameters, position_enu_m: Vector
) -> Zone | None:
    """Return the nearest zone that will do, of the near map or, where that has none, of the far one."""
    for zones in (report.zones, report.far.zones):
        usable = [zone for zone in zones if _usable(zone, refused_enu_m, parameters)]
        if usable:
            return min(usable, key=lambda zone: float(np.hypot(*(zone.best.enu_m - position_enu_m)[:2])))
    return None


def _usable(zone: Zone, refused_enu_m: Sequence[Vector], parameters: Parameters) -> bool:
    far = all(np.hypot(*(zone.best.enu_m[:2] - point[:2])) > REFUSE_WITHIN_M for point in refused_enu_m)
    certain = zone.best.certainty >= parameters.min_certainty
    return far and certain and bool(np.isfinite(zone.best.enu_m).all())
