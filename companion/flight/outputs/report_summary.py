"""Summaries of a report for JSON: zones, landing point, ways in and out, surface, and choice of the map."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slz import (
    SAFE,
    UNKNOWN,
    UNSAFE,
    Corridors,
    LandingPoint,
    LocalFrame,
    Obstacle,
    Report,
    SelectedPoint,
    SurfaceHere,
    SurfaceKind,
    Zone,
)

WORDS = {int(SAFE): "clear", int(UNSAFE): "blocked", int(UNKNOWN): "unknown"}
MOST_OBSTACLES = 20


def corridor_summary(corridors: Corridors | None) -> dict[str, Any]:
    """Return the state of the best way, that straight down, and the clear bearings; None unjudged."""
    if corridors is None:
        return {"corridors": None}
    return {
        "corridors": {
            "state": WORDS[corridors.state],
            "overhead": WORDS[corridors.overhead],
            "bearings_deg": list(corridors.bearings_deg),
        }
    }


def footing_summary(best: LandingPoint) -> dict[str, Any]:
    """Return headings to land at, what excludes the others, and the areas by D; None where not judged."""
    return {
        "headings_deg": None if best.headings_deg is None else list(best.headings_deg),
        "blocked_by": best.blocked_by or None,
        "areas": None if best.areas is None else best.areas.text,
    }


def headings_text(best: LandingPoint) -> str:
    """Return the headings to land at in words: any, none, or degrees; empty where not judged."""
    if best.headings_deg is None:
        return ""
    if best.can_land_at_any_heading:
        return "any"
    return " ".join(map(str, best.headings_deg)) or "none"


def surface_summary(surface: SurfaceHere) -> dict[str, Any]:
    """Return a surface in words, its probability, that of water, and a roof's height; None where unknown."""
    unknown = surface.kind is SurfaceKind.UNKNOWN
    return {
        "surface": None if unknown else surface.kind.word,
        "surface_probability": None if unknown else _number(surface.probability, 3),
        "water": None if unknown and surface.water == 0 else _number(surface.water, 3),
        "raised_m": _number(surface.raised_m, 1) if surface.kind is SurfaceKind.ROOF else None,
    }


def _number(value: float, digits: int) -> float | None:
    return round(float(value), digits) if math.isfinite(value) else None


def zone_summary(zone: Zone, frame: LocalFrame) -> dict[str, Any]:
    """Return a zone with its landing point; `why`: the reason it ranks behind the zone before it."""
    lat, lon, alt = (float(v) for v in frame.lla(zone.best.enu_m))
    return {
        "id": zone.id,
        "area_m2": round(zone.area_m2, 2),
        "certainty": round(zone.certainty, 4),
        "slope_deg": round(zone.slope_deg, 2),
        "roughness": round(zone.roughness, 4),
        "square_side_m": round(zone.best.square_side_m, 2),
        "clearance_m": round(zone.best.clearance_m, 2),
        "point_certainty": round(zone.best.certainty, 4),
        **surface_summary(zone.best.surface),
        **footing_summary(zone.best),
        **corridor_summary(zone.best.corridors),
        "why": zone.why,
        "lat": lat,
        "lon": lon,
        "alt_m": alt,
        "obstacles": len(zone.obstacles),
    }


def choice_summary(report: Report) -> dict[str, Any]:
    """Return mode, cell sizes and window of the last report, and the inputs of their choice."""
    choice = report.choice
    return {
        "mode": "far" if choice.far else "near",
        "near_cell_m": report.near.grid.cell_m,
        "far_cell_m": report.far.grid.cell_m,
        "window_s": choice.window_s,
        "density_per_m2": round(choice.density_per_m2, 1),
        "height_m": round(choice.height_m, 1) if math.isfinite(choice.height_m) else None,
        "speed_ms": round(choice.speed_ms, 1),
        "far_zones": len(report.far.zones),
    }


def point_summary(point: SelectedPoint, frame: LocalFrame) -> dict[str, Any]:
    """Return the state of the selected point and the obstacles around it, nearest first."""
    lat, lon, alt = (float(v) for v in frame.lla(np.nan_to_num(point.enu_m)))
    found: dict[str, Any] = {
        "state": point.state.value,
        "judged_by": point.judged_by,
        "lat": lat,
        "lon": lon,
        "alt_m": alt,
        "certainty": round(point.certainty, 4) if math.isfinite(point.certainty) else None,
        **surface_summary(point.surface),
        "headings_deg": list(point.footing.headings_deg),
        "blocked_by": point.footing.blocked_by or None,
        **corridor_summary(point.corridors),
        "way_in_deg": None,
        "obstacles": [],
    }
    if point.surroundings is not None:
        way_in = point.surroundings.way_in()
        found["way_in_deg"] = None if way_in is None else round(math.degrees(way_in[0]))
        nearest = point.surroundings.obstacles[:MOST_OBSTACLES]
        found["obstacles"] = [_obstacle(obstacle, point, frame) for obstacle in nearest]
    return found


def _obstacle(obstacle: Obstacle, point: SelectedPoint, frame: LocalFrame) -> dict[str, Any]:
    lat, lon, alt = (float(v) for v in obstacle.lla(frame))
    return {
        "lat": lat,
        "lon": lon,
        "alt_m": round(alt, 2),
        "height_m": round(obstacle.height_m, 2),
        "width_m": round(obstacle.width_m, 2),
        "distance_m": round(obstacle.distance_m(point.enu_m), 2),
    }
