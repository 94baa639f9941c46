"""Field parsing of text lines: separators, decimal commas, column names and their units."""

from __future__ import annotations

import csv
import re

NAMES = (
    frozenset({"x", "easting", "east", "lon", "longitude", "points:0", "points_0"}),
    frozenset({"y", "northing", "north", "lat", "latitude", "points:1", "points_1"}),
    frozenset({"z", "elevation", "height", "alt", "altitude", "points:2", "points_2"}),
)
LENGTHS_M = {"m": 1.0, "metre": 1.0, "metres": 1.0, "meter": 1.0, "meters": 1.0} | {
    "ft": 0.3048, "feet": 0.3048, "foot": 0.3048, "us-ft": 1200 / 3937, "ftus": 1200 / 3937,
}  # fmt: skip
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
WHOLE = re.compile(r"[+-]?\d+")
_UNIT = re.compile(r"(.*?)\s*[\[(]\s*([^\])]*?)\s*[\])]")


def separator_of(line: str) -> str | None:
    """Return the separator of a line's fields; None for whitespace."""
    if ";" in line:
        return ";"
    if "\t" in line.strip():
        return "\t" if all(field.strip() for field in line.strip().split("\t")) else None
    if "," not in line or sum(number(word) is not None for word in line.split()) >= 3:
        return None  # commas are decimal
    return ","


def split(line: str, separator: str | None) -> list[str]:
    """Return the fields of a line without surrounding spaces and quotes."""
    line = line.strip()
    if '"' in line and separator is not None:
        fields = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    else:
        fields = line.split(separator)
    return [field.strip(" \t\"'") for field in fields]


def number(field: str) -> float | None:
    """Return the value of a field with a decimal point or comma; None if it is no number."""
    if DECIMAL_COMMA.fullmatch(field):
        field = field.replace(",", ".")
    try:
        return float(field)
    except ValueError:
        return None


def names_decimal_commas(line: str, separator: str | None) -> bool:
    """Return whether a comma-separated line also has decimal commas, recognised by fractions such as 002.

    `1,5, 2,5, 3,5` has them; so does `500000,251,5000000,013,100,002`, since whole numbers have no leading
    zeros.
    """
    if separator != ",":
        return False
    spaced = re.split(r",\s+", line.strip())
    if len(spaced) >= 3 and sum(DECIMAL_COMMA.fullmatch(word) is not None for word in spaced) >= 2:
        return True
    fields = split(line, separator)
    whole = len(fields) >= 4 and all(WHOLE.fullmatch(field) for field in fields)
    return whole and any(len(field) > 1 and field[0] == "0" for field in fields)


def columns_of(names: list[str]) -> tuple[int, ...] | None:
    """Return the columns of x, y and z by their names; None if one of them is missing or duplicate."""
    plain = [without_unit(name)[0] for name in names]
    found = [[k for k, name in enumerate(plain) if name in wanted] for wanted in NAMES]
    return tuple(places[0] for places in found) if all(len(places) == 1 for places in found) else None


def without_unit(name: str) -> tuple[str, float | None]:
    """Return a column's name in lower case without its unit, and the unit in metres or None."""
    name = name.lower()
    found = _UNIT.fullmatch(name)
    if found is None or found[2] not in LENGTHS_M:
        return name, None
    return found[1], LENGTHS_M[found[2]]
