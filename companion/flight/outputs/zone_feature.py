"""GeoJSON feature (RFC 7946) of a zone."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import mapping
from shapely.geometry.polygon import orient

from companion.flight.outputs.zone_outline import DEGREE_DECIMALS, zone_polygon
from companion.flight.outputs.zone_summary import zone_summary
from slz import Grid, LocalFrame, Zone


def zone_feature(zone: Zone, grid: Grid, frame: LocalFrame) -> dict[str, Any]:
    """Return a zone's polygons with holes in longitude and latitude, with its summary as properties."""
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
        "properties": zone_summary(zone, frame),
    }
