"""Unit and datum of a file's heights, as its CRS, its GeoTIFF keys and the user state them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pyproj import CRS
from pyproj.crs import CompoundCRS, VerticalCRS
from pyproj.crs.coordinate_system import VerticalCS
from pyproj.crs.enums import VerticalCSAxis

from companion.desk.clouds import geokeys
from companion.desk.clouds.geokeys import GeoKeys
from companion.desk.clouds.unit_statements import ELLIPSOID, Statement, refuse_datums, refuse_units
from companion.runtime.errors import UsageError

UNITS_M = {"m": 1.0, "ft": 0.3048, "us-ft": 1200 / 3937}  # values of --vertical-unit
AXES = {
    "m": VerticalCSAxis.GRAVITY_HEIGHT,
    "ft": VerticalCSAxis.GRAVITY_HEIGHT_FT,
    "us-ft": VerticalCSAxis.GRAVITY_HEIGHT_US_FT,
}
BY_UNIT = "name the unit of heights by --vertical-unit"
BY_DATUM = "name the right CRS with its heights by --crs, such as --crs EPSG:2992+5703"
Origin = Literal["crs", "geokeys", "option", "horizontal unit", "metre"]


@dataclass(frozen=True, slots=True)
class Heights:
    """Unit and datum of the heights of a file.

    unit_m: metres per unit, None where nothing states it. origin: source of the unit. vertical: the CRS of
    the datum, in any unit; None for ellipsoidal or unknown heights. datum: its name. stated: whether either
    is known.
    """

    unit_m: float | None
    origin: Origin
    vertical: CRS | None
    datum: str | None

    @property
    def stated(self) -> bool:
        return self.unit_m is not None or self.datum is not None


def unit_of_option(text: str) -> float:
    """Return the metres per unit of `--vertical-unit`.

    Raises
    ------
    UsageError
        It is none of `UNITS_M`.
    """
    if text not in UNITS_M:
        raise UsageError(f"--vertical-unit {text!r}: write {', '.join(UNITS_M)}")
    return UNITS_M[text]


def heights_of(crs: CRS | None, keys: GeoKeys, owner: str, option: str | None) -> Heights:
    """Return the heights that a CRS, GeoTIFF keys and `--vertical-unit` state.

    Raises
    ------
    UsageError
        They contradict each other, heights count downwards, or a code is unknown.
    """
    parts = [*_of_crs(crs), *_of_code(keys, owner, option)]
    for _, part in parts:
        if part is not None and part.axis_info[-1].direction.lower() != "up":
            raise UsageError(f"{owner}: heights of {part.name!r} do not count upwards: convert them")
    stated = [statement for statement, _ in parts]
    code = keys.epsg(geokeys.VERTICAL_DATUM)
    by_datum = Statement(f"its GeoTIFF key of their datum, {code}", datum=geokeys.datum_of(code))
    refuse_datums(owner, "heights", [*stated, by_datum], BY_DATUM)
    vertical = next((part for _, part in parts if part is not None and part.is_vertical), None)
    datum = next((one.datum for one in [*stated, by_datum] if one.datum is not None), None)
    if option is not None:
        return Heights(unit_of_option(option), "option", vertical, datum)
    code = keys.code(geokeys.VERTICAL_UNIT)
    by_unit = Statement(f"its GeoTIFF key of their unit, {code}", geokeys.lengths_m().get(code or 0))
    refuse_units(owner, "heights", [*stated, by_unit], BY_UNIT)
    unit_m = next((one.unit for one in stated if one.unit is not None), None)
    if unit_m is not None:
        return Heights(unit_m, "crs", vertical, datum)
    if code is not None and by_unit.unit is None:
        raise UsageError(
            f"{owner}: its GeoTIFF key of the unit of heights, {code}, is no known length: {BY_UNIT}"
        )
    return Heights(by_unit.unit, "geokeys", vertical, datum)


def with_heights(crs: CRS, horizontal: CRS, heights: Heights, unit_m: float) -> CRS:
    """Return a CRS with the heights of `heights` in the given unit, or without them.

    Above an ellipsoid it is three-dimensional, as far as PROJ has that: in metres.
    """
    own = _vertical(crs)
    if own is not None and abs(own.axis_info[-1].unit_conversion_factor / unit_m - 1) < 1e-6:
        return crs
    if heights.vertical is None and own is None and heights.datum == ELLIPSOID and unit_m == 1.0:
        return crs.to_3d()
    if heights.vertical is None:
        return horizontal if own is not None else crs
    vertical = _in_unit(heights.vertical, unit_m)
    return (
        horizontal
        if vertical is None
        else CompoundCRS(f"{horizontal.name} + {vertical.name}", [horizontal, vertical])
    )


def _in_unit(vertical: CRS, unit_m: float) -> CRS | None:
    """Return a vertical CRS in another unit; None where PROJ has no axis of that unit."""
    if abs(vertical.axis_info[0].unit_conversion_factor / unit_m - 1) < 1e-6:
        return vertical
    unit = next((name for name, metres in UNITS_M.items() if abs(metres / unit_m - 1) < 1e-6), None)
    if unit is None or vertical.datum is None:
        return None
    name = f"{vertical.datum.name} height ({unit})"
    return VerticalCRS(name, vertical.datum, VerticalCS(axis=AXES[unit]))


def _vertical(crs: CRS) -> CRS | None:
    """Return the part of a CRS that has the heights: a vertical or three-dimensional one."""
    if crs.is_bound and crs.source_crs is not None:
        return _vertical(crs.source_crs)
    if crs.is_compound:
        return _vertical(crs.sub_crs_list[1])
    return crs if crs.is_vertical or (len(crs.axis_info) == 3 and not crs.is_geocentric) else None


def _statement(who: str, crs: CRS) -> Statement:
    """Return the unit and datum of the heights of a CRS."""
    axis = crs.axis_info[-1]
    datum = (crs.datum.name if crs.datum is not None else None) if crs.is_vertical else ELLIPSOID
    return Statement(who, float(axis.unit_conversion_factor), datum)


def _of_crs(crs: CRS | None) -> list[tuple[Statement, CRS | None]]:
    """Return the statements of a CRS and of its own EPSG code, each with its CRS."""
    own = None if crs is None else _vertical(crs)
    if own is None:
        return []
    statements: list[tuple[Statement, CRS | None]] = [(_statement(f"its CRS {own.name!r}", own), own)]
    code = geokeys.own_code(own)
    listed = geokeys.crs_of(code)
    vertical = None if listed is None else _vertical(listed)
    if vertical is not None:
        statements.append((_statement(f"its code EPSG:{code}", vertical), vertical))
    return statements


def _of_code(keys: GeoKeys, owner: str, option: str | None) -> list[tuple[Statement, CRS | None]]:
    """Return the statement of the GeoTIFF key of the vertical CRS, and its CRS.

    Raises
    ------
    UsageError
        The code is unknown, and the user gives no unit.
    """
    code = keys.epsg(geokeys.VERTICAL)
    if code is None:
        return []
    who = f"its GeoTIFF key of the vertical CRS, {code}"
    if code in geokeys.OLD_DATUMS:
        crs = CRS.from_epsg(geokeys.OLD_DATUMS[code])
        return [(Statement(who, None, crs.datum.name if crs.datum is not None else None), crs)]
    if code in geokeys.OLD_ELLIPSOIDS:
        return [(Statement(who, None, ELLIPSOID), None)]
    found = geokeys.crs_of(code)
    vertical = None if found is None else _vertical(found)
    if vertical is not None:
        return [(_statement(who, vertical), vertical)]
    if option is None:
        raise UsageError(f"{owner}: its GeoTIFF key of the vertical CRS, {code}, is no known one: {BY_UNIT}")
    return []
