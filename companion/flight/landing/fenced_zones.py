"""Autopilot's fence: whether a landing point, the way there, and the zones of a report are inside."""

from __future__ import annotations

import numpy as np

from companion.flight.geometry.geofence import Geofence
from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.situation import Situation, Vector
from companion.flight.landing.ways.approach_path import hover_height_m
from params import Parameters
from slz import Report, Zone


def beyond_fence(s: Situation, parameters: Parameters, enu_m: Vector, zone_id: int | None = None) -> str:
    """Return the part of a landing that is beyond the fence, the point or the way there; else ""."""
    name = "point" if zone_id is None else f"zone {zone_id}"
    if not s.fence.holds_landing(enu_m, hover_height_m(parameters)):
        return name
    here = s.position_enu_m
    return "" if here is None or s.fence.holds_way(here, enu_m) else f"way to {name}"


def aim_is_beyond_fence(s: Situation, progress: LandingProgress, parameters: Parameters) -> bool:
    """Return whether the present fence excludes the target point."""
    return not s.fence.holds_landing(progress.aim.on_ground_enu_m, hover_height_m(parameters))


class FencedZones:
    """Zones of the newest report by the autopilot's fence, determined once per report."""

    def __init__(self, parameters: Parameters) -> None:
        self._p = parameters
        self._beyond: tuple[Report, Geofence, frozenset[int]] | None = None  # IDs of the zones beyond it

    def beyond(self, s: Situation) -> frozenset[int]:
        """Return the IDs of the zones whose best point is beyond the fence."""
        report, fence = s.report, s.fence
        if report is None or fence.is_open:
            return frozenset()
        if self._beyond is None or self._beyond[0] is not report or self._beyond[1] is not fence:
            prior = () if report.prior is None else report.prior.zones
            zones = (*report.near.zones, *report.far.zones, *prior)
            points = np.array([zone.best.enu_m for zone in zones]).reshape(-1, 3)
            inside = fence.holds_landings(points, hover_height_m(self._p))
            self._beyond = report, fence, frozenset(zones[k].id for k in np.flatnonzero(~inside))
        return self._beyond[2]

    def is_inside(self, s: Situation, zone: Zone) -> bool:
        """Return whether a zone's best point, and the way there, are inside the fence."""
        return zone.id not in self.beyond(s) and not beyond_fence(s, self._p, zone.best.enu_m)
