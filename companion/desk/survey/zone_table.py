"""Zone attributes: a row of the summary and the properties of a feature of zones.geojson."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from shapely.geometry import MultiPolygon, mapping

from companion.desk.survey.findings import Findings
from companion.desk.survey.local_metres import Metric
from companion.desk.survey.survey_corridors import document, words
from companion.flight.outputs.geojson_features import DEGREE_DECIMALS
from companion.flight.outputs.report_summary import headings_text
from slz import Zone


def rows(findings: Findings) -> list[dict[str, Any]]:
    """Return one JSON object a zone, the best first; why: the reason it ranks behind the one before.

    lat, lon, elevation_m: the landing point, WGS-84 and metres above vertical_datum, the cloud's.
    square_centre: [lon, lat] of the largest safe square. Areas and lengths are those on the ground.
    corridors: the ways in and out, only where they were asked for.
    """
    metric, zones = findings.metric, findings.zones
    if not zones:
        return []
    points = metric.lonlat(np.array([zone.best.enu_m[:2] for zone in zones])).round(DEGREE_DECIMALS)
    centres = metric.lonlat(np.array(findings.square_centres_m)).round(DEGREE_DECIMALS)
    described = [
        {**_row(zone, metric), "obstacles": n, "why": zone.why, "rank": zone.id}
        | {"lat": point[1], "lon": point[0], "square_centre": centre}
        for zone, n, point, centre in zip(
            zones, findings.n_obstacles, points.tolist(), centres.tolist(), strict=True
        )
    ]
    return [row | more for row, more in zip(described, _corridors(findings), strict=True)]


def flat(described: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows with their corridors in words, for tables."""
    return [row | {"corridors": words(row["corridors"])} if "corridors" in row else row for row in described]


def write_geojson(
    path: Path, shapes: Sequence[MultiPolygon], described: Sequence[dict[str, Any]], heights: str
) -> None:
    """Write the zones as a GeoJSON feature collection (RFC 7946: WGS-84, longitude before latitude).

    `heights`: what elevations are counted from, written beside the features.
    """
    with path.open("w", encoding="utf-8") as file:
        file.write(f'{{"type": "FeatureCollection", "vertical_datum": {json.dumps(heights)}, "features": [')
        for k, (shape, row) in enumerate(zip(shapes, described, strict=True)):
            geometry = mapping(shape.geoms[0] if len(shape.geoms) == 1 else shape)
            feature = {"type": "Feature", "id": row["id"], "geometry": geometry, "properties": row}
            file.write((", " if k else "") + json.dumps(feature))
        file.write("]}")


def _corridors(findings: Findings) -> list[dict[str, Any]]:
    """Return the ways in and out of each zone under their name, nothing where they were not asked for."""
    metric, points = findings.metric, np.array([zone.best.enu_m[:2] for zone in findings.zones])
    norths, length = metric.north_deg(points).tolist(), math.sqrt(metric.area_factor)
    return [
        {} if ways is None else {"corridors": document(ways, metric.lonlat, north, length)}
        for ways, north in zip(findings.ways, norths, strict=True)
    ]


def _row(zone: Zone, metric: Metric) -> dict[str, Any]:
    best = zone.best
    length = math.sqrt(metric.area_factor)
    return {
        "id": zone.id,
        "area_m2": round(zone.area_m2 * metric.area_factor, 3),
        "certainty": round(zone.certainty, 4),
        "slope_deg": _number(zone.slope_deg, 3),
        "roughness": _number(zone.roughness, 4),
        "square_side_m": round(best.square_side_m * length, 3),
        "square_centre": None,
        "lat": None,
        "lon": None,
        "elevation_m": _number(metric.altitude_m(float(best.enu_m[2])), 3),
        "vertical_datum": metric.reference.heights,
        "point_certainty": round(best.certainty, 4),
        "point_slope_deg": _number(best.slope_deg, 3),
        "clearance_m": round(best.clearance_m * length, 3),
        "surface": best.surface.kind.word,
        "surface_probability": _number(best.surface.probability, 3),
        "water": round(best.surface.water, 3),
        "raised_m": _number(best.surface.raised_m, 2),
        "headings": headings_text(best),
        "blocked_by": best.blocked_by,
        "areas": "" if best.areas is None else best.areas.text,
        "boundary_points": len(zone.boundary_cells),
        "corner_points": len(zone.corners_enu_m),
    }


def _number(value: float, digits: int) -> float | None:
    return round(value, digits) if math.isfinite(value) else None  # JSON knows no NaN
