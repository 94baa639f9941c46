"""Outline of a zone as polygons with holes, in metres of the map frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, Polygon

from slz import Grid, Zone
from slz.zones.polygonise import polygonise

DEGREE_DECIMALS = 9  # a tenth of a millimetre


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
