"""Choice of the landing zone."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from operator import itemgetter

import numpy as np

from companion.flight.geometry.wind import Wind
from companion.flight.landing.fenced_zones import FencedZones
from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.orders.confirmation import must_be_confirmed
from companion.flight.landing.situation import Emergency, Situation, Vector
from companion.flight.landing.ways.endurance import Endurance, reach_time_s
from params import Parameters
from slz import Report, Zone

REFUSE_WITHIN_M = 6.0
Inside = Callable[[Zone], bool]


def _anywhere(_zone: Zone) -> bool:
    return True


def choose(
    zones: Sequence[Zone],
    refused_enu_m: Sequence[Vector],
    parameters: Parameters,
    drift_m: float = 0.0,
    inside: Inside = _anywhere,
) -> Zone | None:
    """Return the best ranked usable zone that needs no confirmation, or None.

    Its best point must be certain enough, and not near a point refused before. With a drift by gusts it
    must be farther from the zone's edge than that and the touchdown error.

    Parameters
    ----------
    inside
        True for a zone that is, with the way there, inside the autopilot's fence.
    """
    room_m = parameters.touchdown_error_m + drift_m if drift_m else 0.0
    certainty = parameters.min_certainty
    wide = (zone for zone in zones if zone.best.clearance_m >= room_m)
    usable = (zone for zone in wide if _usable(zone, refused_enu_m, certainty))
    simple = (zone for zone in usable if not must_be_confirmed(zone.best.surface, parameters))
    return next((zone for zone in simple if inside(zone)), None)


def look_at(
    report: Report, refused_enu_m: Sequence[Vector], parameters: Parameters, inside: Inside = _anywhere
) -> Zone | None:
    """Return the best zone of the survey prior that needs no confirmation, None without one.

    It is not certain: the vehicle waits above its point until the live maps judge that safe.
    """
    zones = () if report.prior is None else report.prior.zones
    usable = (zone for zone in zones if _usable(zone, refused_enu_m, 0.0))
    simple = (zone for zone in usable if not must_be_confirmed(zone.best.surface, parameters))
    return next((zone for zone in simple if inside(zone)), None)


def confirmable(zones: Sequence[Zone], parameters: Parameters, inside: Inside = _anywhere) -> Zone | None:
    """Return the best ranked zone that is certain enough and waits for a confirmation, or None."""
    certain = (zone for zone in zones if _usable(zone, (), parameters.min_certainty))
    asking = (zone for zone in certain if must_be_confirmed(zone.best.surface, parameters))
    return next((zone for zone in asking if inside(zone)), None)


def soonest(
    report: Report,
    refused_enu_m: Sequence[Vector],
    parameters: Parameters,
    position_enu_m: Vector,
    wind: Wind | None = None,
    endurance_s: float | None = None,
    inside: Inside = _anywhere,
) -> tuple[Zone, float] | None:
    """Return the usable zone reached soonest, with the time in s: of the near map, the far one, or the prior.

    A map counts only where those before it have no zone that the wind and the battery let the vehicle reach;
    zones that need a confirmation (roofs, low vegetation) only where no map has another. Where none is
    within reach, the soonest of all is the best that is left.

    Parameters
    ----------
    wind
        None while it is unknown.
    endurance_s
        How long the battery lasts, None while that is unknown.
    inside
        True for a zone that is, with the way there, inside the autopilot's fence.
    """
    prior = () if report.prior is None else report.prior.zones
    least = parameters.min_certainty
    maps = ((report.zones, least), (report.far.zones, least), (prior, 0.0))
    limit_s = math.inf if endurance_s is None else endurance_s
    left: list[tuple[float, Zone]] = []
    for confirm, (zones, certainty) in itertools.product((False, True), maps):
        timed = [
            (reach_time_s(position_enu_m, zone.best.enu_m, parameters, wind), zone)
            for zone in zones
            if _usable(zone, refused_enu_m, certainty)
            and must_be_confirmed(zone.best.surface, parameters) is confirm
        ]
        found = next((one for one in sorted(timed, key=itemgetter(0)) if inside(one[1])), None)
        if found is not None:
            if found[0] <= limit_s and math.isfinite(found[0]):
                return found[1], found[0]
            left.append(found)
    if not left:
        return None
    seconds, zone = min(left, key=lambda one: one[0])
    return zone, seconds


class SoonestZone:
    """Usable zone that is reached soonest, inside the fence and away from refused points."""

    def __init__(
        self, parameters: Parameters, progress: LandingProgress, fenced: FencedZones, endurance: Endurance
    ) -> None:
        self._p, self._progress, self._fenced, self._endurance = parameters, progress, fenced, endurance

    def zone(self, s: Situation) -> Zone | None:
        """Return the zone, None without one."""
        found = self.zone_and_s(s)
        return None if found is None else found[0]

    def zone_and_s(self, s: Situation) -> tuple[Zone, float] | None:
        """Return the zone, and the time until touchdown (s); None without one."""
        if s.report is None or s.position_enu_m is None:
            return None
        endurance_s = self._endurance.left_s(s.now_ns)
        return soonest(
            s.report, self._progress.refused, self._p, s.position_enu_m, s.wind, endurance_s,
            lambda zone: self._fenced.is_inside(s, zone),
        )  # fmt: skip

    def emergency(self, s: Situation) -> Emergency | None:
        """Return where an emergency order would land now, None without a zone."""
        found = self.zone_and_s(s)
        if found is None:
            return None
        zone, seconds = found
        endurance_s = self._endurance.left_s(s.now_ns)
        return Emergency(zone.id, seconds, None if endurance_s is None else seconds <= endurance_s)


def _usable(zone: Zone, refused_enu_m: Sequence[Vector], least_certainty: float) -> bool:
    far = all(np.hypot(*(zone.best.enu_m[:2] - point[:2])) > REFUSE_WITHIN_M for point in refused_enu_m)
    certain = zone.best.certainty >= least_certainty and not zone.best.has_no_heading
    return far and certain and bool(np.isfinite(zone.best.enu_m).all())
