"""What is told of every zone: a row of the summary and a feature of zones.geojson."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from shapely.geometry import mapping

from companion.survey.metric import Metric
from companion.survey.polygon import DECIMALS, wgs84, zone_polygon
from companion.survey.square import square_centre
from slz import TerrainMaps, Zone


def rows(zones: Sequence[Zone], maps: TerrainMaps, metric: Metric) -> list[dict[str, Any]]:
    """Return one JSON object a zone, the best first; why: what places it behind the one before.

    lat, lon, elevation_m: the landing point, WGS-84 and metres above the cloud's vertical datum.
    square_centre: [lon, lat] of the largest safe square. Areas and lengths are those on the ground.
    """
    return [{**_row(zone, maps, metric), "rank": rank} for rank, zone in enumerate(zones, start=1)]


def write_geojson(
    path: Path, zones: Sequence[Zone], described: Sequence[dict[str, Any]], maps: TerrainMaps, metric: Metric
) -> None:
    """Write the zones as a GeoJSON feature collection (RFC 7946: WGS-84, longitude before latitude)."""
    features = []
    for zone, row in zip(zones, described, strict=True):
        shape = wgs84(zone_polygon(zone, maps.grid), metric)
        geometry = mapping(shape.geoms[0] if len(shape.geoms) == 1 else shape)
        features.append({"type": "Feature", "id": zone.id, "geometry": geometry, "properties": row})
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), "utf-8")


def _row(zone: Zone, maps: TerrainMaps, metric: Metric) -> dict[str, Any]:
    best = zone.best
    here = metric.lonlat(np.array([best.enu_m[:2], square_centre(zone, maps)]))
    length = math.sqrt(metric.area_factor)
    return {
        "id": zone.id,
        "area_m2": round(zone.area_m2 * metric.area_factor, 3),
        "certainty": round(zone.certainty, 4),
        "slope_deg": _number(zone.slope_deg, 3),
        "roughness": _number(zone.roughness, 4),
        "square_side_m": round(best.square_side_m * length, 3),
        "square_centre": here[1].round(DECIMALS).tolist(),
        "lat": round(float(here[0, 1]), DECIMALS),
        "lon": round(float(here[0, 0]), DECIMALS),
        "elevation_m": _number(metric.altitude_m(float(best.enu_m[2])), 3),
        "point_certainty": round(best.certainty, 4),
        "point_slope_deg": _number(best.slope_deg, 3),
        "clearance_m": round(best.clearance_m * length, 3),
        "boundary_points": len(zone.boundary_cells),
        "corner_points": len(zone.corners_enu_m),
        "obstacles": len(zone.obstacles),
        "why": zone.why,
    }


def _number(value: float, digits: int) -> float | None:
    return round(value, digits) if math.isfinite(value) else None  # JSON knows no NaN
