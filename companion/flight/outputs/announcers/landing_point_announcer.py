"""Announcements of state changes of the selected landing point (SLZ thesis, section 4.3.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from companion.flight.landing.orders.confirmation import surface_suffix
from companion.flight.landing.situation import Severity
from params import Parameters
from slz import PointState, Report, SelectedPoint

PAUSE_NS = 1_000_000_000


class LandingPointAnnouncer:
    """Comparison of the selected point with the last announcement.

    A new state is announced at once, a return to the state before the last announcement not within a second.
    """

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._said: tuple[NDArray[np.float64], PointState, str] | None = None
        self._before: tuple[PointState, str] | None = None
        self._said_ns = 0

    def update(self, report: Report) -> tuple[Severity, str] | None:
        """Return severity and text for the pilot after a window, None without a change."""
        point = report.selected
        if point is None:
            self._said = None
            return None
        same = self._said is not None and np.array_equal(self._said[0], point.enu_m)
        surface = point.surface
        water = ": may be water" if surface.water > self._parameters.water_suspicion else ""
        reason = water or _no_heading(point)
        kind = ":".join(reason.split(":")[:2])  # without heights and distances, which vary
        kind = kind or (surface.kind.word if point.state is PointState.SAFE else "")
        if same and self._said is not None and self._said[1:] == (point.state, kind):
            return None
        was = self._said[1:] if same and self._said is not None else None
        is_back = was is not None and self._before == (point.state, kind)
        if is_back and report.stamp_ns - self._said_ns < PAUSE_NS and point.state is not PointState.UNSAFE:
            return None
        self._before, self._said_ns = was, report.stamp_ns
        self._said = point.enu_m, point.state, kind
        where = "" if point.zone_id is None else f" in zone {point.zone_id}"
        by = ", far map" if point.judged_by == "far" else ""
        if point.state is PointState.UNSAFE:
            return Severity.CRITICAL, f"SLZ: landing point is UNSAFE{by}{reason}"
        if point.state is PointState.UNKNOWN:
            return Severity.WARNING, f"SLZ: landing point is unknown{by}{water}"
        return Severity.NOTICE, f"SLZ: landing point is safe{where}{by}{surface_suffix(surface)}"


def _no_heading(point: SelectedPoint) -> str:
    """Return what keeps the vehicle from landing at any heading, after a colon; empty where it can."""
    return "" if point.footing.headings_deg else f": {point.footing.blocked_by}"
