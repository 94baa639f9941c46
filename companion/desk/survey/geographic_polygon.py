"""Polygons in longitude and latitude, cut at the date line (RFC 7946)."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, Polygon

from companion.desk.survey.local_metres import Metric
from companion.flight.outputs.geojson_features import DEGREE_DECIMALS


def wgs84(polygons: MultiPolygon, metric: Metric) -> MultiPolygon:
    """Return the polygons in longitude and latitude, outer rings anticlockwise (RFC 7946, section 3.1.6).

    Polygons that cross the date line are cut along it (3.1.9); polygons around a pole are unchanged.
    """

    def to_degrees(local_m: NDArray[np.float64]) -> NDArray[np.float64]:
        return metric.lonlat(local_m).round(DEGREE_DECIMALS)

    turned = shapely.transform(polygons, to_degrees)
    parts = [part for whole in turned.geoms for part in _cut(whole)]
    return MultiPolygon([shapely.geometry.polygon.orient(part, 1.0) for part in parts])


def _cut(polygon: Polygon) -> list[Polygon]:
    """Return a polygon in degrees, or its parts on either side of the date line if it crosses the line."""
    lon = shapely.get_coordinates(polygon.exterior)[:, 0]
    if float(np.ptp(lon)) <= 180:
        return [polygon]
    east = shapely.transform(polygon, lambda xy: np.column_stack([xy[:, 0] % 360, xy[:, 1]]))
    if not east.is_valid:
        return [polygon]
    halves = (
        shapely.intersection(east, shapely.box(0, -90, 180, 90)),
        shapely.transform(
            shapely.intersection(east, shapely.box(180, -90, 360, 90)), lambda xy: xy - (360, 0)
        ),
    )
    return [
        part
        for half in halves
        for part in getattr(half, "geoms", [half])
        if isinstance(part, Polygon) and part.area
    ]
