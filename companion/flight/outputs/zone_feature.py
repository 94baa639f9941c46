"""GeoJSON features (RFC 7946) of zones."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import mapping
from shapely.geometry.polygon import orient

from companion.flight.outputs.corridor_ranges import corridor_ranges
from companion.flight.outputs.zone_outline import DEGREE_DECIMALS, zone_polygon
from companion.flight.outputs.zone_summary import zone_summary
from slz import Grid, LocalFrame, Report, Zone


def zone_features(report: Report) -> list[dict[str, Any]]:
    """Return the zones of both maps of a report, each with its `map`, near or far."""
    features = []
    for name, part in (("near", report.near), ("far", report.far)):
        for zone in part.zones:
            feature = zone_feature(zone, part.grid, report.frame)
            feature["properties"]["map"] = name
            features.append(feature)
    return features


def zone_feature(zone: Zone, grid: Grid, frame: LocalFrame) -> dict[str, Any]:
    """Return a zone's polygons with holes in longitude and latitude, with its summary as properties.

    Its `corridors` also hold `corridor_ranges`, the ways in and out at the least slope.
    """
    up_m = float(np.nan_to_num(zone.best.enu_m[2]))

    def degrees(local_m: NDArray[np.float64]) -> NDArray[np.float64]:
        enu = np.column_stack([local_m, np.full(len(local_m), up_m)])
        return np.asarray(frame.lla(enu)[:, [1, 0]].round(DEGREE_DECIMALS))

    shape = shapely.transform(zone_polygon(zone, grid), degrees)
    parts = [orient(part, 1.0) for part in shape.geoms]
    geometry = mapping(parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts))
    return {
        "type": "Feature",
        "id": zone.id,
        "geometry": geometry,
        "properties": _properties(zone, frame),
    }


def _properties(zone: Zone, frame: LocalFrame) -> dict[str, Any]:
    told = zone_summary(zone, frame)
    if zone.best.corridors is not None:
        told["corridors"] |= corridor_ranges(zone.best.corridors, lambda _, top: _place(top, frame))
    return told


def _place(enu_m: NDArray[np.float64], frame: LocalFrame) -> dict[str, float]:
    lat, lon, _ = frame.lla(enu_m).round(DEGREE_DECIMALS).tolist()
    return {"lat": lat, "lon": lon}
