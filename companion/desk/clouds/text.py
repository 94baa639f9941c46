"""Reader of text clouds: one point a line, x y z and other fields, with spaces, tabs, commas or semicolons.

The first line that is no comment may name the columns; without names the first three are x, y and z. Lines
that begin with # or // are comments; one of them before the points may also name the columns, as
CloudCompare writes it. A lone whole number before the points is their count. Commas may be decimal ones
where something else separates the fields. Only x, y and z need be numbers.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from companion.desk.clouds.cloud_source import CHUNK, NO_STEPS, Chunk, finite, translated
from companion.desk.clouds.crs import Reference
from companion.desk.clouds.laz_chunks import check_none_follow
from companion.desk.clouds.records import MOST_LINE, from_lines, refuse_carriage_returns, truncated
from companion.desk.clouds.unit_statements import Statement, refuse_units
from companion.runtime.errors import UsageError

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

COMMENTS = ("#", "//")
BLOCK = 1 << 20  # bytes
EXAMINED = 1000  # lines searched for decimal commas beside separating ones
FOOT_SAME = 1e-5  # names of columns do not distinguish the two feet


@dataclass(frozen=True, slots=True)
class Beginning:
    """Lines before the points. skipped: number of lines. count: of points, if a line of its own states it."""

    skipped: int
    columns: tuple[int, ...]
    separator: str | None
    names: list[str]
    count: int | None


@dataclass(frozen=True, slots=True)
class TextSource:
    """A text file, see `Source`."""

    path: Path
    n_points: int
    reference: Reference
    beginning: Beginning
    clock: None = None
    scales: tuple[float, float, float] = NO_STEPS
    single: bool = False

    def chunks(self) -> Iterator[Chunk]:
        begin, n = self.beginning, 0
        commas = points_ = False
        with translated(self.path), self.path.open("rb") as file:
            for _ in range(begin.skipped):
                file.readline(MOST_LINE)
            lines = _lines(file, self.path)
            while some := list(islice(lines, CHUNK)):
                if begin.separator != "," and any("," in line for line in some):
                    some, has_commas, has_points = _with_points(some, begin)
                    commas, points_ = commas or has_commas, points_ or has_points
                    if commas and points_:
                        raise UsageError(f"{self.path}: it has decimal commas and decimal points: write one")
                    columns: tuple[int, ...] = (0, 1, 2)
                    separator: str | None = ";"
                else:
                    points_ = points_ or any("." in line for line in some[:EXAMINED])
                    columns, separator = begin.columns, begin.separator
                for found in from_lines(iter(some), columns, separator, len(some), self.path):
                    n += len(found)
                    yield finite(found)
            if begin.count is not None and n < begin.count:
                raise truncated(self.path, n, begin.count)
            if begin.count is not None:
                check_none_follow(self.path, begin.count, n - begin.count)


def open_text(path: Path, reference: Reference) -> TextSource:
    """Find the columns of a text file.

    Raises
    ------
    UsageError
        No line is a point, names lack x, y or z or contradict the units of the CRS, columns in degrees have
        no names, or commas are both decimal and separating.
    """
    with translated(path), path.open("rb") as file:
        begin = _beginning(file, path)
        file.seek(0)
        if begin.separator == ",":
            lines = islice(_text(file, path), begin.skipped, begin.skipped + EXAMINED)
            if any(names_decimal_commas(line, ",") for line in lines):
                raise UsageError(
                    f"{path}: it has decimal commas, and commas between its columns: write decimal points, or"
                    " separate the columns by semicolons or tabs"
                )
        if not begin.names and reference.unit_m is None:
            raise UsageError(
                f"{path}: its columns have no names, and {reference.name} counts in degrees: longitude or"
                " latitude may come first; begin the file with a line lon,lat,z or lat,lon,z"
            )
        _refuse_units(path, begin, reference)
        file.seek(0)
        n_lines = sum(block.count(b"\n") for block in iter(lambda: file.read(BLOCK), b"")) + 1
        return TextSource(path, n_lines - begin.skipped, reference, begin)


def _beginning(file: BinaryIO, path: Path) -> Beginning:
    names: list[str] = []
    named = False  # named in a line of its own, not in a comment
    count: int | None = None
    for skipped, line in enumerate(_text(file, path)):
        words = line.strip()
        comment = words.startswith(COMMENTS)
        words = words.lstrip("#/ ") if comment else words
        separator = separator_of(words)
        fields = split(words, separator)
        if comment:
            names = fields if columns_of(fields) is not None else names
            continue
        if not words:
            continue
        if len(fields) == 1 and fields[0].isascii() and fields[0].isdigit() and count is None:
            count = int(fields[0])
            continue
        columns = columns_of(names) if names else (0, 1, 2)
        if columns is not None and _numbers(fields, columns):
            return Beginning(skipped, columns, separator, names, count)
        if named or (names and columns is None):
            if sum(number(field) is not None for field in fields) >= 3:
                raise UsageError(
                    f"{path}: its columns {', '.join(names)[:80]} leave out x, y or z: name them"
                )
            break
        names, named = fields, True
    raise UsageError(f"{path}: it holds no line of three or more numbers x, y, z")


def _numbers(fields: list[str], columns: tuple[int, ...]) -> bool:
    return max(columns) < len(fields) and all(number(fields[k]) is not None for k in columns)


def _with_points(lines: list[str], begin: Beginning) -> tuple[list[str], bool, bool]:
    """Return lines of x;y;z with decimal points, whether any had commas, and whether any had points."""
    out, commas, dots = [], False, False
    for line in lines:
        if not line.strip():
            continue
        fields = split(line, begin.separator)
        if max(begin.columns) >= len(fields):
            out.append(line)  # the parser refuses it and names it
            continue
        wanted = [fields[k] for k in begin.columns]
        found = [DECIMAL_COMMA.fullmatch(field) is not None for field in wanted]
        commas = commas or any(found)
        dots = dots or any("." in field for field in wanted)
        out.append(
            ";".join(
                field.replace(",", ".") if comma else field
                for field, comma in zip(wanted, found, strict=True)
            )
        )
    return out, commas, dots


def _refuse_units(path: Path, begin: Beginning, reference: Reference) -> None:
    """Refuse column names with units that differ from the CRS, such as Z[m] where z is in feet."""
    for column, unit in zip(begin.columns, ("x", "y", "z"), strict=True):
        stated = without_unit(begin.names[column])[1] if begin.names else None
        if stated is None or (unit == "z" and reference.vertical_from == "option"):
            continue
        theirs = reference.vertical_m if unit == "z" else reference.unit_m
        if theirs is not None and abs(stated / theirs - 1) < FOOT_SAME:
            continue
        name = begin.names[column]
        if theirs is None:
            raise UsageError(
                f"{path}: its column {name!r} is a length, {reference.name} in degrees: see --crs"
            )
        remedy = (
            "name the unit of heights by --vertical-unit" if unit == "z" else "name the right CRS by --crs"
        )
        parts = Statement(f"its column {name!r}", stated), Statement(reference.name, theirs)
        refuse_units(str(path), unit, parts, remedy)


def _text(file: BinaryIO, path: Path) -> Iterator[str]:
    while line := file.readline(MOST_LINE):
        refuse_carriage_returns(line, path)
        line = line.rstrip(b"\r\n\x1a")  # Ctrl-Z ends text of DOS
        if len(line) == MOST_LINE:
            raise UsageError(f"{path}: it is no text, a line is longer than {MOST_LINE} bytes")
        yield line.decode("utf-8-sig", "replace")


def _lines(file: BinaryIO, path: Path) -> Iterator[str]:
    """Return the lines that are no comments."""
    return (line for line in _text(file, path) if not line.lstrip().startswith(COMMENTS))


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
