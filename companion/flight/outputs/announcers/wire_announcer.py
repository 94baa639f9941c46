"""Announcements of wires near the vehicle or the landing point, once for each wire."""

from __future__ import annotations

import math

import numpy as np

from companion.flight.landing.situation import Severity, Vector
from slz import LocalFrame, Report, Wire

NEAR_M = 40.0  # from the vehicle
NEAR_POINT_M = 15.0  # from the landing point
SAME_M = 3.0  # from a wire that was announced, and given up: one found again there is the same
MOST_PLACES = 256


class WireAnnouncer:
    """Compares the wires of a report with those that were announced."""

    def __init__(self) -> None:
        self._frame: LocalFrame | None = None
        self._said = set[int]()
        self._places: list[Wire] = []  # of those announced

    def update(self, report: Report) -> tuple[Severity, str] | None:
        """Return severity and text of the nearest wire that is new and matters, None without."""
        if report.frame != self._frame:
            self._frame, self._said, self._places = report.frame, set(), []
        here = _vehicle(report)
        near = [(*_distance_m(wire, here), wire) for wire in report.wires if wire.number not in self._said]
        near = [one for one in near if one[0] <= NEAR_M or _is_near_point(one[2], report)]
        if here is None or not near:
            return None
        self._said.update(wire.number for _, _, wire in near)
        near = [one for one in near if not any(_is_same(one[2], known) for known in self._places)]
        if not near:
            return None
        self._places = [*self._places, *(wire for _, _, wire in near)][-MOST_PLACES:]
        away_m, bearing_deg, _ = min(near, key=lambda one: one[0])
        more = f", {len(near) - 1} more" if len(near) > 1 else ""
        return Severity.WARNING, f"SLZ: wire {away_m:.0f} m away, bearing {bearing_deg:03.0f}{more}"


def _vehicle(report: Report) -> Vector | None:
    """Return the middle (2,) of the heights around the vehicle, which is where it was."""
    around = report.nearby
    if around is None:
        return None
    rows, cols = around.ground_m.shape
    return np.array([around.west_m + cols * around.cell_m / 2, around.south_m + rows * around.cell_m / 2])


def _distance_m(wire: Wire, here: Vector | None) -> tuple[float, float]:
    """Return the horizontal distance to a wire and its bearing (deg)."""
    if here is None:
        return math.inf, 0.0
    points, _, _ = wire.sampled(0.5)
    way = points[:, :2] - here
    nearest = way[np.hypot(*way.T).argmin()]
    return float(np.hypot(*nearest)), round(math.degrees(math.atan2(nearest[0], nearest[1]))) % 360


def _is_same(wire: Wire, known: Wire) -> bool:
    """Return whether what was seen of a wire lies along one that was announced."""
    return all(known.distance_m(end)[0] <= SAME_M for end in wire.ends_enu_m)


def _is_near_point(wire: Wire, report: Report) -> bool:
    return report.selected is not None and wire.distance_m(report.selected.enu_m)[0] <= NEAR_POINT_M
