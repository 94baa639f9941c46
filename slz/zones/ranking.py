"""Ranking of zones, with reasons."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable

from params import Parameters
from slz.frame import is_known
from slz.terrain.terrain_maps import SAFE, UNKNOWN, UNSAFE
from slz.zone import LandingPoint, Zone

WAY_WORDS = {int(SAFE): "clear", int(UNKNOWN): "unseen", int(UNSAFE): "blocked"}

Entry = tuple[tuple[float, ...], Zone]  # ranking criteria of a zone, and the zone


class Ranking:
    """Ranking of zones from window to window, repeated only when the zones changed."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._listed: list[Zone] = []
        self._entries: dict[int, Entry] = {}
        self._ranked: tuple[Zone, ...] = ()
        self._placed: dict[tuple[int, int], tuple[Zone, Zone, Zone]] = {}

    def of(self, zones: list[Zone]) -> tuple[Zone, ...]:
        """Return the ranked zones, see `rank`."""
        if len(zones) == len(self._listed) and all(map(operator.is_, zones, self._listed)):
            return self._ranked
        entries = {}
        for zone in zones:
            known = self._entries.get(zone.id)
            entries[zone.id] = (
                known if known and known[1] is zone else (criteria(zone, self._parameters), zone)
            )
        order = sorted(entries.values(), key=_place, reverse=True)[: self._parameters.max_zones]
        ranked, placed = [], {}
        above: Entry | None = None
        for entry in order:
            mine, zone = entry
            if above is None:
                ranked.append(zone)
            else:
                theirs, other = above
                known_pair = self._placed.get((other.id, zone.id))
                if not (known_pair and known_pair[0] is other and known_pair[1] is zone):
                    known_pair = (
                        other,
                        zone,
                        zone.with_reason(_why(zone, mine, other, theirs, self._parameters)),
                    )
                placed[other.id, zone.id] = known_pair
                ranked.append(known_pair[2])
            above = entry
        self._listed, self._entries, self._ranked, self._placed = zones, entries, tuple(ranked), placed
        return self._ranked


def rank(zones: Iterable[Zone], parameters: Parameters) -> tuple[Zone, ...]:
    """Return zones with the best to land in first, each with the reason for its rank behind the one before.

    Criteria, in this order: a heading to land at, minimum certainty (`min_certainty`), a surface that needs
    no confirmation, areas that fit by the vehicle's D, a way in that is clear,
    clearance up to `enough_m`, certainty, slope, horizon on the approach, distance. Each is quantised, so
    that an irrelevant difference leaves the decision to the next criterion.
    """
    return Ranking(parameters).of(list(zones))


def _place(entry: Entry) -> tuple[tuple[float, ...], int]:
    return entry[0], -entry[1].id


def _why(
    zone: Zone, mine: tuple[float, ...], above: Zone, theirs: tuple[float, ...], parameters: Parameters
) -> str:
    """Return the reason for a zone's rank behind another."""
    for place, (own, other) in enumerate(zip(mine, theirs, strict=True)):
        if own != other:
            text, text_above = (criteria_text(one, parameters)[place] for one in (zone, above))
            return f"{text}, zone {above.id} {text_above.split(' ', 1)[1]}"
    return "found later"


def enough_m(parameters: Parameters) -> float:
    """Return the clearance above which more is no better: four footprints or the safe square's side."""
    return max(parameters.min_square_m, 4 * parameters.footprint_m)


def _way_in(best: LandingPoint) -> int:
    return int(UNKNOWN) if best.corridors is None else best.corridors.state


def criteria(zone: Zone, parameters: Parameters) -> tuple[float, ...]:
    """Return the quantised ranking criteria of a zone, the most important first; greater is better."""
    best, enough = zone.best, enough_m(parameters)
    placed = is_known(best.enu_m)
    horizon_deg = 90.0 if math.isnan(best.horizon_deg) else max(0.0, best.horizon_deg)
    distance_m = best.distance_m if math.isfinite(best.distance_m) else 0.0
    return (
        float(not best.has_no_heading),
        float(placed and best.certainty >= parameters.min_certainty),
        float(not best.surface.must_be_confirmed(parameters.roof, parameters.vegetation)),
        0.0 if best.areas is None else float(best.areas.n_met),
        float(_way_in(best) == SAFE),
        math.floor(min(best.clearance_m, enough) / (enough / 8)),
        math.floor(best.certainty * 20),
        -math.floor(best.slope_deg),
        -math.floor(horizon_deg / 5),
        -math.floor(distance_m / 10),
    )


def criteria_text(zone: Zone, parameters: Parameters) -> tuple[str, ...]:
    """Return the text of each ranking criterion."""
    best = zone.best
    placed = is_known(best.enu_m)
    confirm = best.surface.must_be_confirmed(parameters.roof, parameters.vegetation)
    unseen = math.isnan(best.horizon_deg)
    distance_m = best.distance_m if math.isfinite(best.distance_m) else 0.0
    return (
        f"no heading: {best.blocked_by}" if best.has_no_heading else "it has a heading",
        f"certainty {best.certainty:.2f}{'' if placed else ' without height'}",
        f"{best.surface.text}: to be confirmed" if confirm else "surface needs no confirmation",
        "" if best.areas is None else f"fits {best.areas.n_met} of 3 areas by D",
        f"way in {WAY_WORDS[_way_in(best)]}",
        f"clearance {best.clearance_m:.1f} m",
        f"certainty {best.certainty:.2f}",
        f"slope {best.slope_deg:.1f} deg",
        "approach unseen" if unseen else f"approach {max(0.0, best.horizon_deg):.1f} deg",
        f"distance {distance_m:.0f} m",
    )
