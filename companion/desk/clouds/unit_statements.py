"""Statements of a file about units and datums, and the detection of contradictions."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from pyproj import CRS, Transformer
from pyproj.crs import Datum  # type: ignore[attr-defined] # public in its documentation
from pyproj.exceptions import CRSError, ProjError

from companion.runtime.errors import UsageError

SAME = 1e-6  # relative; the international and the US survey foot differ by 2e-6
APART_M = 1.0  # a larger difference of one position's coordinates means two projections
ELLIPSOID = "an ellipsoid"
AMBIGUOUS = {"NAD83": "North American Datum 1983"}  # an alias of several datums in the registry


@dataclass(frozen=True, slots=True)
class Statement:
    """A unit, a datum or both, as one part of a file states them.

    who: the part, as errors name it. unit: metres (or radians). datum: its name. None where not stated.
    """

    who: str
    unit: float | None = None
    datum: str | None = None


def refuse_units(owner: str, of: str, stated: Sequence[Statement], remedy: str) -> None:
    """Raise `UsageError` where two statements have units of different length."""
    known = [one for one in stated if one.unit is not None]
    for one in known[1:]:
        first = known[0]
        if first.unit is not None and one.unit is not None and abs(one.unit / first.unit - 1) > SAME:
            raise UsageError(
                f"{owner}: its unit of {of} is {unit_name(first.unit)} by {first.who}, but"
                f" {unit_name(one.unit)} by {one.who}: {remedy}"
            )


def refuse_datums(owner: str, of: str, stated: Sequence[Statement], remedy: str) -> None:
    """Raise `UsageError` where two statements have different datums that PROJ knows."""
    known = [one for one in stated if one.datum is not None and _known(one.datum) is not None]
    for one in known[1:]:
        first = known[0]
        if first.datum is not None and one.datum is not None and _known(first.datum) != _known(one.datum):
            raise UsageError(
                f"{owner}: its datum of {of} is {first.datum} by {first.who}, but {one.datum} by {one.who}:"
                f" {remedy}"
            )


def refuse_projections(owner: str, one: tuple[str, CRS], other: tuple[str, CRS], remedy: str) -> None:
    """Raise `UsageError` where two projected CRS map one position to different coordinates."""
    area = other[1].area_of_use or one[1].area_of_use
    if area is None or not (one[1].is_projected and other[1].is_projected):
        return
    lon = (area.west + (area.east if area.east >= area.west else area.east + 360)) / 2
    places = [_metres(crs, lon, (area.south + area.north) / 2) for _, crs in (one, other)]
    distance = math.dist(*places)
    if math.isfinite(distance) and distance > APART_M:
        raise UsageError(
            f"{owner}: its projection is {one[1].name!r} by {one[0]}, but {other[1].name!r} by {other[0]}:"
            f" {remedy}"
        )


def _metres(crs: CRS, lon: float, lat: float) -> tuple[float, float]:
    geodetic = crs.geodetic_crs
    if geodetic is None:
        return math.nan, math.nan
    try:
        to_crs = Transformer.from_crs(geodetic.to_2d(), crs, always_xy=True)
        x, y = to_crs.transform(lon, lat, errcheck=True)
    except ProjError:
        return math.nan, math.nan
    unit_m = crs.axis_info[0].unit_conversion_factor
    return float(x) * unit_m, float(y) * unit_m


def _known(name: str) -> str | None:
    """Return the EPSG name of a datum without case, spaces and punctuation; None for an unknown one."""
    if name == ELLIPSOID:
        return name
    spaced = AMBIGUOUS.get(name, name.replace("_", " "))
    for spelt in (spaced, name, f"D_{name}"):
        try:
            return _plain(Datum.from_name(spelt, auth_name="EPSG").name)
        except CRSError:
            continue
    return None


def _plain(name: str) -> str:
    return re.sub("[^a-z0-9]", "", name.lower().removesuffix(" ensemble"))


def unit_name(length_m: float) -> str:
    """Return the name of a length (m) or angle (rad) as in GDAL, else the length in metres."""
    lengths = ("m", 1.0), ("ft", 0.3048), ("US survey foot", 1200 / 3937)
    for name, metres in (*lengths, ("degree", math.pi / 180), ("grad", math.pi / 200)):
        if abs(length_m / metres - 1) < 1e-7:
            return name
    return f"{length_m:.9g} m"
