"""Confirmation of an order to land on ground such as a roof: the same order once more."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from companion.flight.landing.aim import same_place
from companion.flight.landing.landing_progress import LandingProgress
from companion.flight.landing.situation import Phase, Situation, Vector
from params import Parameters
from slz import Report, SurfaceHere, SurfaceKind, Zone
from slz.surface.surface_kinds import UNKNOWN_SURFACE

SECOND = 1_000_000_000
EARLIEST_NS, LATEST_NS = SECOND, 30 * SECOND  # a packet sent twice is no confirmation
SAME_M = 1.0  # between two points that an operator marks as one
USUAL = frozenset({SurfaceKind.UNKNOWN, SurfaceKind.BARE})


@dataclass(frozen=True, slots=True)
class Ground:
    """Ground that an order names. zone_id: None for a point outside of every zone."""

    enu_m: Vector
    zone_id: int | None
    surface: SurfaceHere

    @property
    def name(self) -> str:
        """The zone by its ID, or the point."""
        return "the point" if self.zone_id is None else f"zone {self.zone_id}"

    @property
    def text(self) -> str:
        """The name, and the surface where that is unusual."""
        return self.name + surface_suffix(self.surface)

    def is_same(self, other: Ground) -> bool:
        """Return whether the other is the same zone or point, with the same kind of surface."""
        if self.surface.kind is not other.surface.kind:
            return False
        if self.zone_id is not None and self.zone_id == other.zone_id:
            return True
        return float(np.hypot(*(self.enu_m - other.enu_m)[:2])) <= SAME_M


class Confirmation:
    """Memory of the order that waits for its confirmation."""

    def __init__(self) -> None:
        self._asked: tuple[Ground, int] | None = None

    def is_given(self, ground: Ground, now_ns: int) -> bool:
        """Return whether this order confirms the one before; otherwise it waits for its confirmation."""
        if self._asked is not None and self._asked[0].is_same(ground):
            since_ns = now_ns - self._asked[1]
            if since_ns < EARLIEST_NS:
                return False
            if since_ns <= LATEST_NS:
                self._asked = None
                return True
        self._asked = ground, now_ns
        return False


def surface_suffix(surface: SurfaceHere) -> str:
    """Return a surface other than bare ground as the end of a text: ": roof, 25 m up"."""
    return "" if surface.kind in USUAL else f": {surface.text}"


def ground_at(s: Situation, enu_m: Vector, zone_id: int | None = None) -> Ground:
    """Return the ground at a point: as judged there, else that of its zone, else unknown."""
    zone = None if s.report is None else _zone_of(s.report, enu_m, zone_id)
    found_id = zone_id if zone is None else zone.id
    if s.selected is not None and same_place(s.selected.enu_m, enu_m):
        return Ground(enu_m, found_id, s.selected.surface)
    return Ground(enu_m, found_id, UNKNOWN_SURFACE if zone is None else zone.best.surface)


def must_be_confirmed(surface: SurfaceHere, parameters: Parameters) -> bool:
    """Return whether a landing on a surface needs the operator's confirmation."""
    return surface.must_be_confirmed(parameters.roof, parameters.vegetation)


def unconfirmed(s: Situation, progress: LandingProgress, parameters: Parameters) -> str | None:
    """Return the surface at the point, if a landing there lacks its confirmation; otherwise None."""
    selected, request = s.selected, progress.request
    if selected is None or not progress.aim.is_at(selected):
        return None
    surface = selected.surface
    if progress.is_urgent or not must_be_confirmed(surface, parameters):
        return None
    if request is None and progress.phase is Phase.FINAL:  # resumed: confirmed before the restart
        return None
    return None if request is not None and request.confirmed is surface.kind else surface.text


def _zone_of(report: Report, enu_m: Vector, zone_id: int | None) -> Zone | None:
    """Return the zone with an ID, or the one that holds a point."""
    prior = () if report.prior is None else report.prior.zones
    if zone_id is not None:
        zones = (*report.zones, *report.far.zones, *prior)
        return next((zone for zone in zones if zone.id == zone_id), None)
    row, col = report.grid.index(float(enu_m[0]), float(enu_m[1]))
    return next((zone for zone in report.zones if zone.holds(row, col)), None)
