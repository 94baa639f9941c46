"""GeoJSON features (RFC 7946) of zones, wires and moving objects."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, Polygon, mapping
from shapely.geometry.polygon import orient

from companion.flight.outputs.corridor_ranges import corridor_ranges
from companion.flight.outputs.report_summary import zone_summary
from slz import Grid, LocalFrame, Report, Wire, Zone
from slz.zones.polygonise import polygonise

DEGREE_DECIMALS = 9  # a tenth of a millimetre
STEP_M = 5.0


def zone_polygon(zone: Zone, grid: Grid) -> MultiPolygon:
    """Return the outline of a zone's cells with holes, in metres of the map frame; see `polygonise`."""
    corner = np.array([grid.west_m + zone.box.col0 * grid.cell_m, grid.south_m + zone.box.row0 * grid.cell_m])

    def metres(ring: NDArray[np.float64]) -> NDArray[np.float64]:
        return corner + ring * grid.cell_m

    return MultiPolygon(
        [
            Polygon(metres(part.outer), [metres(hole) for hole in part.holes])
            for part in polygonise(zone.cells)
        ]
    )


def wire_summary(wire: Wire, frame: LocalFrame) -> dict[str, Any]:
    """Return a wire as JSON: where it was seen from and to, and what is known of it."""
    return {
        "number": wire.number,
        "ends": [_place(end, frame) for end in wire.ends_enu_m],
        "length_m": round(wire.stop_m - wire.start_m, 1),
        "extrapolated_m": [round(wire.start_m - wire.from_m, 1), round(wire.to_m - wire.stop_m, 1)],
        "at_support": list(wire.at_support),
        "height_sd_m": round(float(wire.curve.height_sd_m(np.array([wire.start_m, wire.stop_m])).max()), 2),
        "returns": wire.n_returns,
    }


def wire_feature(wire: Wire, frame: LocalFrame) -> dict[str, Any]:
    """Return a wire as a GeoJSON feature (RFC 7946): a line with altitudes, extrapolated parts included."""
    points, _, _ = wire.sampled(STEP_M)
    lat, lon, alt = np.asarray(frame.lla(points)).T
    places = np.column_stack([lon.round(DEGREE_DECIMALS), lat.round(DEGREE_DECIMALS), alt.round(2)])
    return {
        "type": "Feature",
        "id": f"wire {wire.number}",
        "geometry": {"type": "LineString", "coordinates": places.tolist()},
        "properties": wire_summary(wire, frame),
    }


def _place(enu_m: np.ndarray[Any, Any], frame: LocalFrame) -> dict[str, float]:
    lat, lon, alt = (float(v) for v in frame.lla(enu_m))
    return {"lat": round(lat, DEGREE_DECIMALS), "lon": round(lon, DEGREE_DECIMALS), "alt_m": round(alt, 2)}


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
        told["corridors"] |= corridor_ranges(zone.best.corridors, lambda _, top: _lat_lon(top, frame))
    return told


def _lat_lon(enu_m: NDArray[np.float64], frame: LocalFrame) -> dict[str, float]:
    lat, lon, _ = frame.lla(enu_m).round(DEGREE_DECIMALS).tolist()
    return {"lat": lat, "lon": lon}


def hazard_features(
    wires: Iterable[Wire], moving: Iterable[Mapping[str, Any]], frame: LocalFrame
) -> list[dict[str, Any]]:
    """Return the wires as lines with altitudes, and what moves as points.

    Parameters
    ----------
    moving
        Objects of the state document: `number`, `enu_m` and `velocity_ms` (2,), `radius_m` and `height_m`.
    """
    features = [wire_feature(wire, frame) for wire in wires]
    for feature in features:
        feature["properties"]["kind"] = "wire"
    return features + [_moving_feature(one, frame) for one in moving]


def _moving_feature(one: Mapping[str, Any], frame: LocalFrame) -> dict[str, Any]:
    lat, lon, _ = (float(v) for v in frame.lla([*one["enu_m"], 0.0]))
    east_ms, north_ms = one["velocity_ms"]
    return {
        "type": "Feature",
        "id": f"moving {one['number']}",
        "geometry": {
            "type": "Point",
            "coordinates": [round(lon, DEGREE_DECIMALS), round(lat, DEGREE_DECIMALS)],
        },
        "properties": {
            "kind": "moving",
            "number": one["number"],
            "speed_ms": round(math.hypot(east_ms, north_ms), 1),
            "course_deg": round(math.degrees(math.atan2(east_ms, north_ms))) % 360,
            "radius_m": one["radius_m"],
            "height_m": one["height_m"],
        },
    }
