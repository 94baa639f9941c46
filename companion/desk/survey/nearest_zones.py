"""Nearest-zone query over the spatial index of zones.fgb (`slz nearest`)."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import shapely
from pyproj import Geod

from companion.desk.survey.flatgeobuf import zones_within
from companion.runtime.errors import UsageError

FIRST_M, FARTHEST_M = 500.0, 2_000_000.0
WIDER = 4.0
METRES_PER_DEGREE = 110_500.0  # of latitude, at least
EARTH = Geod(ellps="WGS84")


def nearest(
    folder: Path, lat: float, lon: float, radius_m: float | None = None, most: int = 10
) -> dict[str, Any]:
    """Return the zones that hold a position, then the others by distance to their landing points.

    Parameters
    ----------
    folder
        Results of `slz map`.
    radius_m
        Largest distance of landing points; zones that hold the position always count. By default the radius
        grows until `most` zones are found.

    Returns
    -------
    Zones with distance_m and bearing_deg (from the position to the landing point) and holds (whether the
    position is in the zone); no_zone, the reason why there is none; query_ms.

    Raises
    ------
    UsageError
        The position is not on the Earth, the radius is no length, or the folder holds no survey or a damaged
        one.
    """
    if not (-90 <= lat <= 90 and -180 <= lon <= 180):
        raise UsageError(f"{lat}, {lon} is no position: latitude, then longitude, in degrees")
    if radius_m is not None and not 0 < radius_m <= FARTHEST_M:
        raise UsageError(f"--radius-m {radius_m:g}: a length of up to {FARTHEST_M:.0f} m")
    if most < 1:
        raise UsageError(f"--most {most}: one at least")
    path = folder / "zones.fgb"
    if not path.is_file():
        raise UsageError(f"{folder}: there is no zones.fgb: name the folder of a survey by --survey")
    began = time.perf_counter()
    reach = radius_m or FIRST_M
    while True:
        found = _within(path, lat, lon, reach)
        if radius_m is not None or len(found) >= most or reach >= FARTHEST_M:
            break
        reach = min(reach * WIDER, FARTHEST_M)
    return {
        "lat": lat,
        "lon": lon,
        "radius_m": radius_m,
        "zones": found[:most],
        "no_zone": None if found else f"the survey holds none within {reach:g} m",
        "query_ms": round((time.perf_counter() - began) * 1e3, 2),
    }


def _within(path: Path, lat: float, lon: float, reach_m: float) -> list[dict[str, Any]]:
    """Return the zones that hold a position, then those whose landing points are within a distance of it."""
    north = reach_m / METRES_PER_DEGREE
    shrink = math.cos(math.radians(min(abs(lat) + north, 89.9)))
    east = min(north / shrink, 180.0)
    # A box across the date line is widened to all longitudes.
    west_lon, east_lon = (lon - east, lon + east) if lon - east >= -180 and lon + east <= 180 else (-180, 180)
    box = (west_lon, max(lat - north, -90.0), east_lon, min(lat + north, 90.0))
    try:
        rows, outlines = zones_within(path, box)
    except Exception as error:  # GDAL raises several kinds of exceptions, some of them not its own
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
        raise UsageError(f"{path}: it is damaged ({reason}): survey again") from None
    here = shapely.Point(lon, lat)
    found = []
    for row, outline in zip(rows, outlines, strict=True):
        forward, _, distance = EARTH.inv(lon, lat, row["lon"], row["lat"])
        holds = bool(shapely.from_wkb(outline).contains(here))
        if holds or distance <= reach_m:
            relation = {"distance_m": round(distance, 2), "bearing_deg": round(forward % 360, 1)}
            found.append(row | relation | {"holds": holds})
    return sorted(found, key=lambda row: (not row["holds"], row["distance_m"], row["id"]))
