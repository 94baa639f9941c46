"""Which zone is better: a ranked list with reasons."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable
from dataclasses import dataclass

from params import Parameters
from slz.zone import Zone

Entry = tuple[tuple[float, ...], Zone]


@dataclass(frozen=True, slots=True)
class Criterion:
    """One thing that decides between two zones: its steps, the greater the better, and its text."""

    step: float
    text: str


class Ranking:
    """Ranks zones from window to window, and only anew when they changed."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._listed: list[Zone] = []
        self._entries: dict[int, Entry] = {}
        self._ranked: tuple[Zone, ...] = ()
        self._placed: dict[tuple[int, int], tuple[Zone, Zone, Zone]] = {}

    def of(self, zones: list[Zone]) -> tuple[Zone, ...]:
        """Return what `rank` does."""
        if len(zones) == len(self._listed) and all(map(operator.is_, zones, self._listed)):
            return self._ranked
        entries = {}
        for zone in zones:
            known = self._entries.get(zone.id)
            entries[zone.id] = known if known and known[1] is zone else (_steps(zone, self._parameters), zone)
        order = sorted(entries.values(), key=_place)[: self._parameters.max_zones]
        ranked, placed = [], {}
        above: Zone | None = None
        for _, zone in order:
            if above is None:
                ranked.append(zone)
            else:
                known_pair = self._placed.get((above.id, zone.id))
                if not (known_pair and known_pair[0] is above and known_pair[1] is zone):
                    known_pair = above, zone, zone.placed(_why(zone, above, self._parameters))
                placed[above.id, zone.id] = known_pair
                ranked.append(known_pair[2])
            above = zone
        self._listed, self._entries, self._ranked, self._placed = zones, entries, tuple(ranked), placed
        return self._ranked


def rank(zones: Iterable[Zone], parameters: Parameters) -> tuple[Zone, ...]:
    """Return zones with the best to land in first, each told why it is not before the one before it.

    What counts, in this order: certain enough at all (`min_certainty`), clearance up to `enough_m`,
    certainty, slope, the horizon on the way in, distance. Each counts in steps, so that a difference that
    does not matter leaves the word to what comes after it.
    """
    return Ranking(parameters).of(list(zones))


def _place(entry: Entry) -> tuple[tuple[float, ...], int]:
    return entry[0], entry[1].id


def _steps(zone: Zone, parameters: Parameters) -> tuple[float, ...]:
    """Return what a zone is sorted by, the least first."""
    return tuple(-criterion.step for criterion in criteria(zone, parameters))


def _why(zone: Zone, above: Zone, parameters: Parameters) -> str:
    """Return what places a zone behind another."""
    for mine, theirs in zip(criteria(zone, parameters), criteria(above, parameters), strict=True):
        if mine.step != theirs.step:
            return f"{mine.text}, zone {above.id} {theirs.text.split(' ', 1)[1]}"
    return "found later"


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
            -math.floor(horizon_deg / 5), "approach unseen" if unseen else f"approach {horizon_deg:.1f} deg"
        ),
        Criterion(-math.floor(distance_m / 10), f"distance {distance_m:.0f} m"),
    )
