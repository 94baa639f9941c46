"""Ranking of zones, with reasons."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable

from params import Parameters
from slz.frame import is_known
from slz.terrain.terrain_maps import SAFE, UNKNOWN, UNSAFE
from slz.zone import LandingPoint, Zone

WAY_WORDS = {int(SAFE): "clear", int(UNKNOWN): "unseen", int(UNSAFE): "blocked"}

Entry = tuple[tuple[float, ...], Zone]  # ranking criteria of a zone, and the zone


def rank(zones: Iterable[Zone], parameters: Parameters) -> tuple[Zone, ...]:
    """Return zones with the best to land in first, each with the reason for its rank behind the one before.

    Criteria, in this order: a heading to land at, minimum certainty (`min_certainty`), a surface that needs
    no confirmation, areas that fit by the vehicle's D, a way in that is clear,
    clearance up to `enough_m`, certainty, slope, horizon on the approach, distance. Each is quantised, so
    that an irrelevant difference leaves the decision to the next criterion.
    """
    order = in_order(((criteria(zone, parameters), zone) for zone in zones), parameters.max_zones)
    pairs = itertools.pairwise(order)
    others = (entry[1].with_reason(reason(entry, above, parameters)) for above, entry in pairs)
    return (*(zone for _, zone in order[:1]), *others)


def in_order(entries: Iterable[Entry], most: int) -> list[Entry]:
    """Return the best zones, by criteria and then by ID, with their criteria."""
    return sorted(entries, key=lambda entry: (entry[0], -entry[1].id), reverse=True)[:most]


def reason(entry: Entry, above: Entry, parameters: Parameters) -> str:
    """Return the reason for a zone's rank behind another."""
    (mine, zone), (theirs, other) = entry, above
    for place, (own, better) in enumerate(zip(mine, theirs, strict=True)):
        if own != better:
            text, text_above = (criteria_text(one, parameters)[place] for one in (zone, other))
            return f"{text}, zone {other.id} {text_above.split(' ', 1)[1]}"
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
