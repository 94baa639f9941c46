"""Touchdown heading: into the wind, among those at which the landing gear stands at the point."""

from __future__ import annotations

import math

from slz import SelectedPoint
from slz.terrain.footing import ALL_HEADINGS
from slz.terrain.gear import HEADING_ERROR_DEG

WITHIN_DEG = HEADING_ERROR_DEG  # of a heading at which the gear stands, and rotor and tail are clear


def touchdown_heading_rad(
    selected: SelectedPoint | None, heading_rad: float | None, into_wind_rad: float | None = None
) -> float | None:
    """Return the safe heading nearest into the wind, or without wind to the present one.

    None where any heading will do.
    """
    if selected is None or not selected.footing.headings_deg:
        return None
    if len(selected.footing.headings_deg) == len(ALL_HEADINGS):
        return into_wind_rad
    present_rad = heading_rad or 0.0
    best_rad = present_rad if into_wind_rad is None else into_wind_rad

    def effort(heading: float) -> tuple[float, float]:
        return round(abs(_turn_rad(heading, best_rad)), 3), abs(_turn_rad(heading, present_rad))

    return min(map(math.radians, selected.footing.headings_deg), key=effort)


def stands_at(selected: SelectedPoint | None, heading_rad: float | None) -> bool:
    """Return whether the gear stands at the present heading; an unknown heading is not safe."""
    if selected is not None and not selected.footing.headings_deg:
        return False
    return is_turned(selected, heading_rad)


def is_turned(
    selected: SelectedPoint | None, heading_rad: float | None, into_wind_rad: float | None = None
) -> bool:
    """Return whether the present heading is the touchdown heading, or any will do."""
    wanted_rad = touchdown_heading_rad(selected, heading_rad, into_wind_rad)
    if wanted_rad is None:
        return True
    return heading_rad is not None and abs(_turn_rad(wanted_rad, heading_rad)) <= math.radians(WITHIN_DEG)


def _turn_rad(to_rad: float, from_rad: float) -> float:
    return math.remainder(to_rad - from_rad, 2 * math.pi)
