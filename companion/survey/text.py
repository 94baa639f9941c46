"""Points as text: one a line, x y z and whatever else, separated by spaces, tabs, commas or semicolons.

The first line that is no comment may name the columns; without names the first three are x, y and z. Lines
that begin with # or // are comments, but one of them before the points may name the columns too, as
CloudCompare writes it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from companion.errors import UsageError
from companion.survey.records import MOST_LINE, from_lines
from companion.survey.reference import Reference
from companion.survey.source import Chunk, finite, translated

NAMES = (
    frozenset({"x", "easting", "east", "lon", "longitude"}),
    frozenset({"y", "northing", "north", "lat", "latitude"}),
    frozenset({"z", "elevation", "height", "alt", "altitude"}),
)
COMMENTS = ("#", "//")
BLOCK = 1 << 20  # bytes


@dataclass(frozen=True, slots=True)
class TextSource:
    """A file of text, see `Source`. skipped: lines before the points."""

    path: Path
    n_points: int
    reference: Reference
    columns: tuple[int, ...]
    separator: str | None
    skipped: int
    clock: None = None
    single: bool = False

    def chunks(self) -> Iterator[Chunk]:
        with translated(self.path), self.path.open("rb") as file:
            for _ in range(self.skipped):
                file.readline(MOST_LINE)
            lines = _lines(file, self.path)
            for points in from_lines(lines, self.columns, self.separator, self.n_points, self.path):
                yield finite(points)


def open_text(path: Path, reference: Reference) -> TextSource:
    """Find the columns of a file of text.

    Raises
    ------
    UsageError
        No line is a point, or names leave out x, y or z.
    """
    with translated(path), path.open("rb") as file:
        skipped, columns, separator = _beginning(file, path)
        file.seek(0)
        n_lines = sum(block.count(b"\n") for block in iter(lambda: file.read(BLOCK), b"")) + 1
        return TextSource(path, n_lines - skipped, reference, columns, separator, skipped)


def _beginning(file: BinaryIO, path: Path) -> tuple[int, tuple[int, ...], str | None]:
    """Return how many lines stand before the points, the columns of x, y, z and what separates them."""
    names: list[str] = []
    named = False  # by a line of its own, not by a comment
    for skipped, line in enumerate(_text(file, path)):
        words = line.strip()
        comment = words.startswith(COMMENTS)
        words = words.lstrip("#/ ") if comment else words
        separator = next((mark for mark in ",;" if mark in words), None)
        fields = [word.strip(" \t\"'").lower() for word in words.split(separator)]
        if comment:
            names = fields if _columns(fields) is not None else names
        elif not words:
            continue
        elif _is_point(fields):
            columns = _columns(names) if names else (0, 1, 2)
            if columns is None:
                raise UsageError(
                    f"{path}: its columns {', '.join(names)[:80]} leave out x, y or z: name them"
                )
            return skipped, columns, separator
        elif named:
            break
        else:
            names, named = fields, True
    raise UsageError(f"{path}: it holds no line of three or more numbers x, y, z")


def _text(file: BinaryIO, path: Path) -> Iterator[str]:
    while line := file.readline(MOST_LINE):
        if len(line) == MOST_LINE:
            raise UsageError(f"{path}: it is no text, a line is longer than {MOST_LINE} bytes")
        yield line.decode("utf-8-sig", "replace")


def _lines(file: BinaryIO, path: Path) -> Iterator[str]:
    """Return the lines that are no comments."""
    return (line for line in _text(file, path) if not line.lstrip().startswith(COMMENTS))


def _is_point(fields: list[str]) -> bool:
    try:
        return len([float(field) for field in fields if field]) >= 3
    except ValueError:
        return False


def _columns(names: list[str]) -> tuple[int, ...] | None:
    """Return the columns of x, y and z by their names; None if one of them is missing or there twice."""
    found = [[k for k, name in enumerate(names) if name in wanted] for wanted in NAMES]
    return tuple(places[0] for places in found) if all(len(places) == 1 for places in found) else None
