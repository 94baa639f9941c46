"""Summaries of a report's zones, landing point and choice, for JSON."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from companion.flight.outputs.corridor_summary import corridor_summary
from companion.flight.outputs.footing_summary import footing_summary
from companion.flight.outputs.surface_summary import surface_summary
from slz import LocalFrame, Obstacle, Report, SelectedPoint, Zone

MOST_OBSTACLES = 20


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
