"""Zones as polygons in metres and in degrees."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, Polygon

from companion.survey.metric import Metric
from slz import Grid, Zone
from slz.outline import outline

DECIMALS = 9  # of a degree: a tenth of a millimetre


def zone_polygon(zone: Zone, grid: Grid) -> MultiPolygon:
    """Return the outline of a zone's cells, holes included, in metres of the map, see `slz.outline`."""
    corner = np.array([grid.west_m + zone.box.col0 * grid.cell_m, grid.south_m + zone.box.row0 * grid.cell_m])

    def metres(ring: NDArray[np.float64]) -> NDArray[np.float64]:
        return corner + ring * grid.cell_m

    return MultiPolygon(
        [Polygon(metres(part.outer), [metres(hole) for hole in part.holes]) for part in outline(zone.cells)]
    )


def wgs84(polygons: MultiPolygon, metric: Metric) -> MultiPolygon:
    """Return the polygons in longitude and latitude, outer rings anticlockwise (RFC 7946 §3.1.6)."""

    def to_degrees(local_m: NDArray[np.float64]) -> NDArray[np.float64]:
        return metric.lonlat(local_m).round(DECIMALS)

    turned = shapely.transform(polygons, to_degrees)
    return MultiPolygon([shapely.geometry.polygon.orient(part, 1.0) for part in turned.geoms])
