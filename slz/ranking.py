"""Which zone is better: a ranked list with reasons."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from params import Parameters
from slz.zone import Zone


@dataclass(frozen=True, slots=True)
class Criterion:
    """One thing that decides between two zones: its steps, the greater the better, and its text."""

    step: float
    text: str


def rank(zones: Iterable[Zone], parameters: Parameters) -> tuple[Zone, ...]:
    """Return zones with the best to land in first, each told why it is not before the one before it.

    What counts, in this order: certain enough at all (`min_certainty`), clearance up to `enough_m`,
    certainty, slope, the horizon on the way in, distance. Each counts in steps, so that a difference that
    does not matter leaves the word to what comes after it.
    """
    listed = [(criteria(zone, parameters), zone) for zone in zones]
    listed.sort(key=lambda entry: (*(-criterion.step for criterion in entry[0]), entry[1].id))
    ranked = []
    for place, (mine, zone) in enumerate(listed):
        if place == 0:
            ranked.append(zone)
            continue
        above, best = listed[place - 1]
        decisive = next((i for i, c in enumerate(mine) if c.step != above[i].step), None)
        why = (
            "found later"
            if decisive is None
            else f"{mine[decisive].text}, zone {best.id} {above[decisive].text.split(' ', 1)[1]}"
        )
        ranked.append(replace(zone, why=why))
    return tuple(ranked[: parameters.max_zones])


def enough_m(parameters: Parameters) -> float:
    """Return the clearance beyond which more is no better: four footprints or the safe square's side."""
    return max(parameters.min_square_m, 4 * parameters.footprint_m)


def criteria(zone: Zone, parameters: Parameters) -> tuple[Criterion, ...]:
    """Return what decides on a zone, the most important first."""
    best, enough = zone.best, enough_m(parameters)
    placed = all(map(math.isfinite, best.enu_m))
    certain = placed and best.certainty >= parameters.min_certainty
    unseen = math.isnan(best.horizon_deg)
    horizon_deg = 90.0 if unseen else max(0.0, best.horizon_deg)
    distance_m = best.distance_m if math.isfinite(best.distance_m) else 0.0
    return (
        Criterion(float(certain), f"certainty {best.certainty:.2f}{'' if placed else ' without height'}"),
        Criterion(
            math.floor(min(best.clearance_m, enough) / (enough / 8)), f"clearance {best.clearance_m:.1f} m"
        ),
        Criterion(math.floor(best.certainty * 20), f"certainty {best.certainty:.2f}"),
        Criterion(-math.floor(best.slope_deg), f"slope {best.slope_deg:.1f} deg"),
        Criterion(
            -math.floor(horizon_deg / 5), "approach unseen" if unseen else f"approach {horizon_deg:.0f} deg"
        ),
        Criterion(-math.floor(distance_m / 10), f"distance {distance_m:.0f} m"),
    )
