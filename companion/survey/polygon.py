"""Zones as polygons along the edges of their cells."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from rasterio.features import shapes
from rasterio.transform import Affine
from shapely.geometry import MultiPolygon, Polygon, shape

from companion.survey.metric import Metric
from slz import Grid, Zone

DECIMALS = 9  # of a degree: a tenth of a millimetre


def zone_polygon(zone: Zone, grid: Grid) -> MultiPolygon:
    """Return the exact outline of a zone's cells, holes included, in metres of the map.

    Cells that touch at a corner only belong to separate polygons, so that the geometry is always valid.
    """
    corner = Affine(
        grid.cell_m,
        0,
        grid.west_m + zone.box.col0 * grid.cell_m,
        0,
        grid.cell_m,
        grid.south_m + zone.box.row0 * grid.cell_m,
    )
    cells = np.ascontiguousarray(zone.cells)
    parts = [shape(ring) for ring, value in shapes(cells, cells == 1, 4, corner) if value == 1]
    polygons: list[Polygon] = []
    for part in parts:
        whole = part if part.is_valid else shapely.make_valid(part)
        polygons += [piece for piece in shapely.get_parts(whole) if isinstance(piece, Polygon)]
    return MultiPolygon(polygons)


def wgs84(polygons: MultiPolygon, metric: Metric) -> MultiPolygon:
    """Return the polygons in longitude and latitude, outer rings anticlockwise (RFC 7946 §3.1.6)."""

    def to_degrees(local_m: NDArray[np.float64]) -> NDArray[np.float64]:
        return metric.lonlat(local_m).round(DECIMALS)

    turned = shapely.transform(polygons, to_degrees)
    return MultiPolygon([shapely.geometry.polygon.orient(part, 1.0) for part in turned.geoms])
