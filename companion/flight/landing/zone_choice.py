"""Choice of the landing zone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from companion.flight.landing.situation import Vector
from params import Parameters
from slz import Report, Zone

REFUSE_WITHIN_M = 6.0


def choose(zones: Sequence[Zone], refused_enu_m: Sequence[Vector], parameters: Parameters) -> Zone | None:
    """Return the best ranked usable zone, or None.

    Its best point must be certain enough, and not near a point refused before.
    """
    return next((zone for zone in zones if _usable(zone, refused_enu_m, parameters.min_certainty)), None)


def look_at(report: Report, refused_enu_m: Sequence[Vector]) -> Zone | None:
    """Return the best zone of the survey prior, None without one.

    It is not certain: the vehicle waits above its point until the live maps judge that safe.
    """
    zones = () if report.prior is None else report.prior.zones
    return next((zone for zone in zones if _usable(zone, refused_enu_m, 0.0)), None)


def soonest(
    report: Report, refused_enu_m: Sequence[Vector], parameters: Parameters, position_enu_m: Vector
) -> Zone | None:
    """Return the nearest usable zone of the near map, else of the far one, else of the survey prior."""
    prior = () if report.prior is None else report.prior.zones
    least = parameters.min_certainty
    for zones, certainty in ((report.zones, least), (report.far.zones, least), (prior, 0.0)):
        usable = [zone for zone in zones if _usable(zone, refused_enu_m, certainty)]
        if usable:
            return min(usable, key=lambda zone: float(np.hypot(*(zone.best.enu_m - position_enu_m)[:2])))
    return None


def _usable(zone: Zone, refused_enu_m: Sequence[Vector], least_certainty: float) -> bool:
    far = all(np.hypot(*(zone.best.enu_m[:2] - point[:2])) > REFUSE_WITHIN_M for point in refused_enu_m)
    certain = zone.best.certainty >= least_certainty
    return far and certain and bool(np.isfinite(zone.best.enu_m).all())
