"""Coordinate reference systems of clouds: what a file says, and how long its units are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pyproj import CRS
from pyproj.exceptions import CRSError

from companion.errors import UsageError

# EPSG codes of lengths that GeoTIFF keys name, in metres.
LENGTHS_M = {9001: 1.0, 9002: 0.3048, 9003: 1200 / 3937}
PROJECTED, GEOGRAPHIC, PROJECTED_UNIT, VERTICAL, VERTICAL_UNIT = 3072, 2048, 3076, 4096, 4099
Origin = Literal["crs", "geokeys", "horizontal unit", "metre"]


@dataclass(frozen=True, slots=True)
class Reference:
    """A CRS with x east and y north, and the length of its height unit.

    horizontal: its two-dimensional part. unit_m: metres per unit of x and y, None for degrees.
    vertical_m: metres per unit of z. vertical_from: who says so; `horizontal unit` and `metre` are the
    convention for files whose CRS has no vertical part (projected and geographic ones).
    """

    crs: CRS
    horizontal: CRS
    unit_m: float | None
    vertical_m: float
    vertical_from: Origin

    @property
    def name(self) -> str:
        parts = self.crs.sub_crs_list if self.crs.is_compound else [self.crs]
        codes = [self.epsg] if self.epsg else [part.to_epsg() for part in parts]
        return f"EPSG:{'+'.join(map(str, codes))}" if all(codes) else str(self.crs.name)

    @property
    def epsg(self) -> int | None:
        """The one code of the EPSG registry that names the CRS; None where there is none."""
        return self.crs.to_epsg()

    @property
    def vertical(self) -> CRS | None:
        """The CRS of the heights; None where it is not told, or they are those of an ellipsoid."""
        return self.crs.sub_crs_list[1] if self.crs.is_compound else None

    def same_as(self, other: Reference) -> bool:
        """Tell whether coordinates of both mean the same place, heights as far as both name their datum."""
        mine, theirs = self.vertical, other.vertical
        return (
            self.horizontal.equals(other.horizontal, ignore_axis_order=True)
            and self.vertical_m == other.vertical_m
            and (mine is None or theirs is None or bool(mine.equals(theirs)))
        )


def from_option(text: str) -> Reference:
    """Read `--crs`: anything PROJ understands, such as EPSG:2992 or EPSG:2992+6360."""
    try:
        crs = CRS.from_user_input(text)
    except CRSError:
        raise UsageError(f"--crs {text!r} is unknown: write it as EPSG:2992 or EPSG:2992+5703") from None
    return of_crs(crs, f"--crs {text!r}")


def of_header(header: Any, path: Path) -> Reference:
    """Read the CRS of a LAS header's records, WKT before GeoTIFF keys, and its units.

    Raises
    ------
    UsageError
        No CRS, one that cannot be read or used, or one that contradicts itself about its unit.
    """
    try:
        crs = header.parse_crs(prefer_wkt=True)
        keys = _geokeys(header)
        if crs is not None and not crs.is_compound and len(crs.axis_info) == 2 and _epsg(keys.get(VERTICAL)):
            crs = CRS.from_user_input(f"{_code(crs)}+{keys[VERTICAL]}") if _code(crs) else crs
    except Exception as error:  # laspy lets errors of several libraries through
        raise UsageError(f"{path}: its CRS cannot be read ({_line(error)}): name it by --crs") from None
    if crs is None:
        user_defined = _epsg(keys.get(PROJECTED)) is False or _epsg(keys.get(GEOGRAPHIC)) is False
        what = "its CRS is written as user-defined GeoTIFF keys" if user_defined else "it names no CRS"
        raise UsageError(f"{path}: {what}: name it by --crs, such as --crs EPSG:2992")
    return of_crs(crs, str(path), keys)


def of_crs(crs: CRS, owner: str, geokeys: dict[int, int] | None = None) -> Reference:
    """Work out the parts and units of a CRS; `owner` names it in errors."""
    keys = geokeys or {}
    horizontal = _horizontal(crs)
    if not (horizontal.is_projected or horizontal.is_geographic):
        kind = horizontal.type_name.lower()
        raise UsageError(f"{owner}: {crs.name!r} is a {kind}: name a projected or geographic one by --crs")
    axes = horizontal.axis_info[:2]
    directions = {axis.direction.lower() for axis in axes}
    if directions not in ({"east", "north"}, {"north"}, {"south"}):  # around a pole both run north or south
        ways = " and ".join(sorted(directions))
        raise UsageError(f"{owner}: the axes of {crs.name!r} run {ways}, not east and north: reproject it")
    unit_m = None
    if horizontal.is_projected:
        unit_m = float(axes[0].unit_conversion_factor)
        stated = LENGTHS_M.get(keys.get(PROJECTED_UNIT, 0))
        if stated is not None and abs(stated / unit_m - 1) > 1e-9:
            raise UsageError(
                f"{owner}: it says its unit is {stated:.6g} m, but that of {crs.name!r} is {unit_m:.6g} m:"
                " name the right CRS by --crs"
            )
    vertical_m, vertical_from = _vertical(crs, keys, unit_m, owner)
    return Reference(crs, horizontal, unit_m, vertical_m, vertical_from)


def unit_name(length_m: float) -> str:
    """Return the name that GDAL gives a length."""
    for name, metres in (("m", 1.0), ("ft", 0.3048), ("US survey foot", 1200 / 3937)):
        if abs(length_m / metres - 1) < 1e-9:
            return name
    return f"{length_m:.9g} m"


def _horizontal(crs: CRS) -> CRS:
    part = crs.sub_crs_list[0] if crs.is_compound else crs
    if part.is_bound and part.source_crs is not None:
        return _horizontal(part.source_crs)
    return part.to_2d() if len(part.axis_info) == 3 and not part.is_geocentric else part


def _vertical(crs: CRS, keys: dict[int, int], unit_m: float | None, owner: str) -> tuple[float, Origin]:
    if crs.is_bound and crs.source_crs is not None:
        return _vertical(crs.source_crs, keys, unit_m, owner)
    axes = crs.sub_crs_list[1].axis_info if crs.is_compound else crs.axis_info[2:]
    if axes:
        if axes[0].direction.lower() != "up":
            raise UsageError(f"{owner}: heights of {crs.name!r} do not count upwards: convert them")
        return float(axes[0].unit_conversion_factor), "crs"
    if keys.get(VERTICAL_UNIT) in LENGTHS_M:
        return LENGTHS_M[keys[VERTICAL_UNIT]], "geokeys"
    return (unit_m, "horizontal unit") if unit_m is not None else (1.0, "metre")


def _geokeys(header: Any) -> dict[int, int]:
    """Return the GeoTIFF keys whose value stands in the directory itself."""
    records = [*header.vlrs, *(header.evlrs or [])]
    directory = next((r for r in records if r.record_id == 34735 and hasattr(r, "geo_keys")), None)
    if directory is None:
        return {}
    return {int(key.id): int(key.value_offset) for key in directory.geo_keys if key.tiff_tag_location == 0}


def _epsg(key: int | None) -> bool | None:
    """Tell whether a key holds a code of the EPSG registry; None where there is no key."""
    return None if key is None else 1024 <= key <= 32766


def _code(crs: CRS) -> str | None:
    code = crs.to_epsg()
    return f"EPSG:{code}" if code else None


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__
