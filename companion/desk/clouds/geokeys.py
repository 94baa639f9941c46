"""GeoTIFF keys of a LAS header and their codes (OGC GeoTIFF 1.1; GeoTIFF 1.0 for old ones)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

from pyproj import CRS
from pyproj.crs import Datum  # type: ignore[attr-defined] # public in its documentation
from pyproj.database import get_units_map
from pyproj.exceptions import CRSError

MODEL, GEOCENTRIC = 1024, 3
GEOGRAPHIC, GEODETIC_DATUM, ANGULAR_UNIT = 2048, 2050, 2054
PROJECTED, PROJECTED_UNIT, PROJECTED_UNIT_SIZE = 3072, 3076, 3077
VERTICAL, VERTICAL_DATUM, VERTICAL_UNIT = 4096, 4098, 4099
DIRECTORY, DOUBLES, WKT = 34735, 34736, 2112
USER_DEFINED = 32767
# Vertical codes of GeoTIFF 1.0, which give a datum but no unit, and the EPSG CRS in metres of the same datum.
OLD_DATUMS = {5101: 5701, 5102: 7968, 5103: 5703, 5104: 5736, 5105: 5705, 5106: 5611}
OLD_ELLIPSOIDS = range(5000, 5100)  # heights above an ellipsoid


@dataclass(frozen=True, slots=True)
class GeoKeys:
    """Keys whose value is in the directory itself, and the doubles of other keys."""

    codes: dict[int, int]
    doubles: dict[int, float]

    def code(self, key: int) -> int | None:
        """Return the code of a key; None where it is absent or undefined (0)."""
        return self.codes.get(key) or None

    def epsg(self, key: int) -> int | None:
        """Return the code of a key if it is in the range of the EPSG registry, else None."""
        code = self.codes.get(key, 0)
        return code if 1024 <= code <= 32766 else None

    def user_defined(self, key: int) -> bool:
        """Return whether a key is present without a code of the EPSG registry."""
        return key in self.codes and self.epsg(key) is None


def of_records(header: Any) -> GeoKeys:
    """Return the GeoTIFF keys among a LAS header's records, including extended ones."""
    records = [*header.vlrs, *(header.evlrs or [])]
    directory = next((r for r in records if r.record_id == DIRECTORY and hasattr(r, "geo_keys")), None)
    if directory is None:
        return GeoKeys({}, {})
    listed = next((r for r in records if r.record_id == DOUBLES and hasattr(r, "doubles")), None)
    values = [float(getattr(one, "value", one)) for one in listed.doubles] if listed is not None else []
    codes = {int(key.id): int(key.value_offset) for key in directory.geo_keys if key.tiff_tag_location == 0}
    doubles = {
        int(key.id): values[key.value_offset]
        for key in directory.geo_keys
        if key.tiff_tag_location == DOUBLES and key.value_offset < len(values)
    }
    return GeoKeys(codes, doubles)


def has_wkt(header: Any) -> bool:
    """Return whether a LAS header holds a CRS as WKT."""
    records = [*header.vlrs, *(header.evlrs or [])]
    return any(r.record_id == WKT and getattr(r, "string", "") for r in records)


@cache
def lengths_m() -> dict[int, float]:
    """Return the linear units of the EPSG registry, metres by code."""
    found = {int(one.code): one.conv_factor for one in get_units_map("EPSG", "linear").values()}
    return found | {9003: 1200 / 3937}  # the US survey foot, which the registry rounds


@cache
def angles_rad() -> dict[int, float]:
    """Return the angular units of the EPSG registry, radians by code."""
    return {int(one.code): one.conv_factor for one in get_units_map("EPSG", "angular").values()}


def crs_of(code: int | None) -> CRS | None:
    """Return the CRS of an EPSG code; None where the registry has none."""
    if code is None:
        return None
    try:
        return CRS.from_epsg(code)
    except CRSError:
        return None


def datum_of(code: int | None) -> str | None:
    """Return the name of the datum of an EPSG code; None where the registry has none."""
    if code is None:
        return None
    try:
        return Datum.from_epsg(code).name
    except CRSError:
        return None


def own_code(crs: CRS) -> int | None:
    """Return the EPSG code that a CRS states, even if the registry disagrees."""
    identifier = crs.to_json_dict().get("id", {})
    return int(identifier["code"]) if identifier.get("authority") == "EPSG" else None
