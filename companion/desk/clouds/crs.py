"""Coordinate reference systems of clouds: those that files state, and the lengths of their units."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pyproj import CRS
from pyproj.exceptions import CRSError

from companion.desk.clouds import geokeys
from companion.desk.clouds.geokeys import GeoKeys
from companion.desk.clouds.unit_statements import (
    ELLIPSOID,
    SAME,
    Statement,
    refuse_datums,
    refuse_projections,
    refuse_units,
)
from companion.desk.clouds.vertical_datum import (
    BY_UNIT,
    Heights,
    Origin,
    heights_of,
    unit_of_option,
    with_heights,
)
from companion.runtime.errors import UsageError

BY_CRS = "name the right CRS by --crs"


@dataclass(frozen=True, slots=True)
class Reference:
    """A CRS with x east and y north, and the length of its height unit.

    horizontal: its two-dimensional part. unit_m: metres per unit of x and y, None for degrees. vertical_m:
    metres per unit of z. vertical_from: source of vertical_m; `option` is `--vertical-unit`, and
    `horizontal unit` and `metre` are the convention for files that state nothing of heights (projected and
    geographic CRS). height_datum: name of the datum of z, None where nothing states it.
    """

    crs: CRS
    horizontal: CRS
    unit_m: float | None
    vertical_m: float
    vertical_from: Origin
    height_datum: str | None = None

    @property
    def heights(self) -> str:
        """Vertical datum of heights, for outputs and errors."""
        if self.height_datum == ELLIPSOID:
            return "ellipsoid"
        return self.height_datum or "unknown: the cloud names no datum of its heights"

    @property
    def is_ellipsoidal(self) -> bool:
        """True if heights are above the ellipsoid, up to 107 m away from mean sea level."""
        return self.height_datum == ELLIPSOID

    @property
    def name(self) -> str:
        parts = self.crs.sub_crs_list if self.crs.is_compound else [self.crs]
        codes = [self.epsg] if self.epsg else [part.to_epsg() for part in parts]
        return f"EPSG:{'+'.join(map(str, codes))}" if all(codes) else str(self.crs.name)

    @property
    def epsg(self) -> int | None:
        """The EPSG code of the whole CRS; None where it has no single code."""
        return self.crs.to_epsg()

    @property
    def vertical(self) -> CRS | None:
        """The CRS of the heights; None where it is unknown, or heights are ellipsoidal."""
        return self.crs.sub_crs_list[1] if self.crs.is_compound else None

    def same_as(self, other: Reference) -> bool:
        """Return whether horizontal CRS, height units and, where both are known, vertical datums agree."""
        mine, theirs = self.vertical, other.vertical
        return (
            self.horizontal.equals(other.horizontal, ignore_axis_order=True)
            and abs(self.vertical_m / other.vertical_m - 1) < SAME
            and (mine is None or theirs is None or bool(mine.equals(theirs)))
        )


def from_option(text: str, vertical_unit: str | None = None) -> Reference:
    """Parse `--crs`, in any notation of PROJ such as EPSG:2992 or EPSG:2992+6360, and `--vertical-unit`."""
    try:
        crs = CRS.from_user_input(text)
    except CRSError:
        raise UsageError(f"--crs {text!r} is unknown: write it as EPSG:2992 or EPSG:2992+5703") from None
    reference = _of_crs(crs, f"--crs {text!r}", None)
    if vertical_unit is None:
        return reference
    stated = [Statement("itself", reference.vertical_m)] if reference.vertical_from == "crs" else []
    asked = Statement("--vertical-unit", unit_of_option(vertical_unit))
    refuse_units(f"--crs {text!r}", "heights", [*stated, asked], "leave one of them out")
    return _of_crs(crs, f"--crs {text!r}", vertical_unit)


def of_header(
    header: Any, path: Path, given: Reference | None = None, vertical_unit: str | None = None
) -> Reference:
    """Read the CRS of a LAS header's records, WKT before GeoTIFF keys, and its units.

    Parameters
    ----------
    given
        CRS of the user. If it states no heights, those that the file states are added.
    vertical_unit
        Unit of the heights of the user, a key of `UNITS_M`.

    Raises
    ------
    UsageError
        No CRS, one that cannot be read or used, or one that contradicts itself about a unit or datum.
    """
    if given is not None and given.vertical_from not in ("horizontal unit", "metre"):
        return given
    try:
        crs = header.parse_crs(prefer_wkt=True)
        keys = geokeys.of_records(header)
    except Exception as error:  # laspy passes on errors of several libraries
        if given is not None:
            return given
        raise UsageError(f"{path}: its CRS cannot be read ({_line(error)}): name it by --crs") from None
    wkt = geokeys.has_wkt(header)
    if keys.code(geokeys.MODEL) == geokeys.GEOCENTRIC and not wkt:
        raise UsageError(
            f"{path}: by its GeoTIFF key of the model its coordinates are geocentric, not x east and y north:"
            " reproject it"
        )
    if given is not None:
        heights = heights_of(crs if wkt else None, keys, str(path), vertical_unit)
        return _joined(given.crs, heights, str(path), given.unit_m) if heights.stated else given
    if crs is None:
        user_defined = keys.user_defined(geokeys.PROJECTED) or keys.user_defined(geokeys.GEOGRAPHIC)
        what = "its CRS is written as user-defined GeoTIFF keys" if user_defined else "it names no CRS"
        raise UsageError(f"{path}: {what}: name it by --crs, such as --crs EPSG:2992")
    return _of_crs(crs, str(path), vertical_unit, keys)


def _of_crs(crs: CRS, owner: str, vertical_unit: str | None, keys: GeoKeys | None = None) -> Reference:
    """Return the parts and units of a CRS; `owner` names it in errors."""
    keys = keys or GeoKeys({}, {})
    horizontal = _horizontal(crs)
    if not (horizontal.is_projected or horizontal.is_geographic):
        kind = horizontal.type_name.lower()
        raise UsageError(f"{owner}: {crs.name!r} is a {kind}: name a projected or geographic one by --crs")
    axes = horizontal.axis_info[:2]
    directions = {axis.direction.lower() for axis in axes}
    if directions not in ({"east", "north"}, {"north"}, {"south"}):  # around a pole both run north or south
        ways = " and ".join(sorted(directions))
        raise UsageError(f"{owner}: the axes of {crs.name!r} run {ways}, not east and north: reproject it")
    _refuse_contradictions(horizontal, owner, keys)
    unit_m = float(axes[0].unit_conversion_factor) if horizontal.is_projected else None
    heights = heights_of(crs, keys, owner, vertical_unit)
    return _joined(crs, heights, owner, unit_m)


def _joined(crs: CRS, heights: Heights, owner: str, unit_m: float | None) -> Reference:
    """Return a CRS with the stated heights, or with those of the convention."""
    horizontal = _horizontal(crs)
    if heights.unit_m is not None:
        vertical_m, origin = heights.unit_m, heights.origin
    elif unit_m is None or unit_m == 1.0 or not heights.stated:
        vertical_m = 1.0 if unit_m is None else unit_m
        origin = "metre" if unit_m is None else "horizontal unit"
    else:
        raise UsageError(
            f"{owner}: it names the datum of its heights ({heights.datum}), but no unit, and x and y are not"
            f" in metres: {BY_UNIT}"
        )
    whole = with_heights(crs, horizontal, heights, vertical_m)
    return Reference(whole, horizontal, unit_m, vertical_m, origin, heights.datum)


def _refuse_contradictions(horizontal: CRS, owner: str, keys: GeoKeys) -> None:
    """Refuse a horizontal CRS that contradicts its own code, or the GeoTIFF keys beside it."""
    name = f"its CRS {horizontal.name!r}"
    coded = [(name, horizontal)]
    own = geokeys.crs_of(geokeys.own_code(horizontal))
    if own is not None:
        coded.append((f"its code EPSG:{geokeys.own_code(horizontal)}", _horizontal(own)))
    geographic = geokeys.crs_of(keys.epsg(geokeys.GEOGRAPHIC))
    for key, label in ((geokeys.PROJECTED, "projected"), (geokeys.GEOGRAPHIC, "geographic")):
        found = geokeys.crs_of(keys.epsg(key))
        if found is not None and (found.is_projected or not keys.epsg(geokeys.PROJECTED)):
            coded.append((f"its GeoTIFF key of the {label} CRS, {keys.epsg(key)}", _horizontal(found)))
    datums = [Statement(who, datum=_datum(crs)) for who, crs in coded]
    datums.append(
        Statement(
            f"its GeoTIFF key of the geographic CRS, {keys.epsg(geokeys.GEOGRAPHIC)}",
            datum=None if geographic is None else _datum(geographic),
        )
    )
    code = keys.epsg(geokeys.GEODETIC_DATUM)
    datums.append(Statement(f"its GeoTIFF key of the datum, {code}", datum=geokeys.datum_of(code)))
    refuse_datums(owner, "x and y", datums, BY_CRS)
    kinds = [Statement(who, 1.0 if crs.is_projected else 2.0) for who, crs in coded]
    if len({one.unit for one in kinds}) > 1:
        other = next(one for one in kinds if one.unit != kinds[0].unit)
        raise UsageError(f"{owner}: {kinds[0].who} and {other.who} are of two kinds: {BY_CRS}")
    units = [Statement(who, float(crs.axis_info[0].unit_conversion_factor)) for who, crs in coded]
    refuse_units(owner, "x and y", [*units, *_keyed_units(keys, horizontal.is_projected)], BY_CRS)
    for one in coded[1:]:
        refuse_projections(owner, coded[0], one, BY_CRS)


def _keyed_units(keys: GeoKeys, projected: bool) -> list[Statement]:
    """Return the units of x and y that GeoTIFF keys state."""
    key = geokeys.PROJECTED_UNIT if projected else geokeys.ANGULAR_UNIT
    code = keys.code(key)
    table = geokeys.lengths_m() if projected else geokeys.angles_rad()
    stated = [Statement(f"its GeoTIFF key of their unit, {code}", table.get(code or 0))]
    if projected:
        size = keys.doubles.get(geokeys.PROJECTED_UNIT_SIZE)
        stated.append(Statement(f"its GeoTIFF key of their unit's size, {size}", size or None))
    return stated


def _datum(crs: CRS) -> str | None:
    geodetic = crs.geodetic_crs
    return None if geodetic is None or geodetic.datum is None else str(geodetic.datum.name)


def _horizontal(crs: CRS) -> CRS:
    part = crs.sub_crs_list[0] if crs.is_compound else crs
    if part.is_bound and part.source_crs is not None:
        return _horizontal(part.source_crs)
    return part.to_2d() if len(part.axis_info) == 3 and not part.is_geocentric else part


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__
