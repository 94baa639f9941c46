"""Local metric coordinates along the axes of a CRS, so that the maps' cells are cells of the CRS."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from pyproj import Geod, Transformer
from pyproj.exceptions import ProjError
from shapely.geometry import MultiPolygon, Polygon

from companion.desk.clouds.crs import Reference
from companion.flight.outputs.geojson_features import DEGREE_DECIMALS
from companion.runtime.errors import UsageError
from slz import LocalFrame

EXACT = 0.002  # relative error up to which the nominal unit of a CRS is kept as its length on the ground
UNEVEN = 0.01  # maximum relative change of a unit's length across a cloud
AHEAD_M = 100.0  # over which the direction of north is measured
EARTH = Geod(ellps="WGS84")
HALF_WAY_M = 2.0e7  # half of the Earth's circumference
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Metric:
    """Metres from an origin in a CRS: x along its easting, y along its northing, z up.

    One unit of x is x_m metres on the map, one of y is y_m, one of z is z_m. A projected CRS keeps the
    nominal length of its unit, so that a cell of 0.5 m is one of 0.5 m in the file; `area_factor` is the
    ratio of ground area (on the ellipsoid) to map area. Where nominal and true lengths differ by 0.2 % or
    more, and in degrees, metres are those on the ground (Web Mercator, for example). wgs84_error_m:
    accuracy of the transformation to WGS-84 as PROJ states it; None where PROJ states none.
    """

    reference: Reference
    origin: tuple[float, float, float]
    x_m: float
    y_m: float
    z_m: float
    area_factor: float
    frame: LocalFrame
    to_wgs84: Transformer
    wgs84_error_m: float | None

    def local(self, points: Floats) -> Floats:
        """Return (n, 3) metres of (n, 3) coordinates of the CRS."""
        return np.ascontiguousarray((points - self.origin) * (self.x_m, self.y_m, self.z_m))

    def crs_xy(self, local_m: Floats) -> Floats:
        """Return (n, 2) coordinates of the CRS of (n, 2 or 3) metres of the map."""
        return np.array(self.origin[:2]) + local_m[:, :2] / (self.x_m, self.y_m)

    def lonlat(self, local_m: Floats) -> Floats:
        """Return (n, 2) longitude and latitude, WGS-84, of (n, 2 or 3) metres of the map."""
        xy = self.crs_xy(local_m)
        return np.column_stack(self.to_wgs84.transform(xy[:, 0], xy[:, 1]))

    def north_deg(self, local_m: Floats) -> Floats:
        """Return (n,) true bearings (deg) of the map's north axis at (n, 2) metres of the map."""
        lon, lat = self.lonlat(local_m).T
        ahead_lon, ahead_lat = self.lonlat(local_m + np.array([0.0, AHEAD_M])).T
        return np.asarray(EARTH.inv(lon, lat, ahead_lon, ahead_lat)[0])

    def altitude_m(self, up_m: Floats | float) -> Any:
        """Return metres above the CRS's vertical datum of metres of the map."""
        return self.origin[2] * self.z_m + up_m


def metric_for(reference: Reference, low: Floats, high: Floats, cell_m: float) -> Metric:
    """Return the local metres of a cloud between two corners, with the origin on a corner of a cell.

    Raises
    ------
    UsageError
        The corners are not on the Earth, or a unit's length varies too much across the cloud. The latter
        includes clouds whose coordinates wrap at 180 degrees.
    """
    half_way = 180.0 if reference.unit_m is None else HALF_WAY_M / reference.unit_m
    if high[0] > low[0] + half_way:
        raise UsageError(
            f"the cloud reaches from {low[0]:.7g} to {high[0]:.7g} in {reference.name}, as clouds across the"
            " 180th meridian do: map either side on its own, or reproject both to UTM"
        )
    try:
        to_wgs84 = Transformer.from_crs(reference.horizontal, "EPSG:4326", always_xy=True)
    except ProjError:  # a CRS of another celestial body
        raise UsageError(
            f"{reference.name}: it is not tied to the Earth: name another CRS by --crs"
        ) from None
    centre = (low + high) / 2
    true = _lengths(reference, centre, low, high)
    nominal = reference.unit_m
    keep = nominal is not None and max(abs(length / nominal - 1) for length in true) < EXACT
    x_m, y_m = (nominal, nominal) if keep and nominal is not None else true
    column, row = x_m / cell_m, y_m / cell_m  # cells per unit
    origin = (
        math.floor(centre[0] * column) / column,
        math.floor(centre[1] * row) / row,
        math.floor(low[2]),
    )
    lon, lat = to_wgs84.transform(centre[0], centre[1])
    return Metric(
        reference=reference,
        origin=origin,
        x_m=x_m,
        y_m=y_m,
        z_m=reference.vertical_m,
        area_factor=true[0] * true[1] / (x_m * y_m),
        frame=LocalFrame(lat, lon, origin[2] * reference.vertical_m),
        to_wgs84=to_wgs84,
        wgs84_error_m=_accuracy_m(to_wgs84),
    )


def _accuracy_m(used: Transformer) -> float | None:
    """Return the accuracy (m) of the operation that the transformer used last; None where PROJ has none."""
    try:
        accuracy = float(used.get_last_used_operation().accuracy)
    except ProjError:  # from WGS-84 to itself
        accuracy = float(used.accuracy)
    return accuracy if accuracy >= 0 else None


def _lengths(reference: Reference, centre: Floats, low: Floats, high: Floats) -> tuple[float, float]:
    """Return the metres on the ground of one unit of x and of y at the centre."""
    geodetic = reference.horizontal.geodetic_crs
    geod = reference.horizontal.get_geod()
    assert geodetic is not None  # noqa: S101 - a projected or geographic CRS has both
    assert geod is not None  # noqa: S101
    step = 1e-3 if reference.unit_m is None else 100 / reference.unit_m
    transformer = Transformer.from_crs(reference.horizontal, geodetic, always_xy=True)
    lengths = []
    for x in (centre[0], low[0], high[0]):
        for y in (centre[1], low[1], high[1]):
            pair = _length(transformer, geod, x, y, step, 0), _length(transformer, geod, x, y, 0, step)
            if not all(math.isfinite(length) and length > 0 for length in pair):
                raise UsageError(
                    f"coordinates around {centre[0]:.0f}, {centre[1]:.0f} are not on the Earth in"
                    f" {reference.name}: name the right CRS by --crs"
                )
            lengths.append(pair)
    spread = (np.array(lengths) / lengths[0] - 1).__abs__().max()
    if spread > UNEVEN:
        raise UsageError(
            f"a unit of {reference.name} changes its length by {spread:.1%} across the cloud: map fewer files"
            " at a time, or reproject them to UTM"
        )
    return lengths[0]


def _length(transformer: Transformer, geod: Geod, x: float, y: float, dx: float, dy: float) -> float:
    """Return the metres on the ground per unit along the axis of the step; NaN off the Earth."""
    try:
        lon, lat = transformer.transform([x - dx, x + dx], [y - dy, y + dy], errcheck=True)
    except ProjError:
        return math.nan
    if not np.isfinite([lon, lat]).all() or max(abs(v) for v in lat) > 90:
        return math.nan
    return float(geod.inv(lon[0], lat[0], lon[1], lat[1])[2]) / (2 * (dx + dy))


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
