"""Points as fixed-size records and as lines of numbers, shared by PCD and PLY."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from companion.desk.clouds.cloud_source import CHUNK
from companion.runtime.errors import UsageError

MOST_HEADER = 1 << 16  # bytes
MOST_LINE = 1 << 16
# Spellings of NaN and infinity by Windows and Fortran.
_NO_NUMBER = re.compile(r"[+-]?(?:nan\([a-z]*\)|1\.#(?:ind|qnan|snan|inf)\d*)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class RecordLayout:
    """Position of the coordinates in a record.

    record_bytes: size of a record. offsets, formats: of x, y, z, in bytes and as NumPy types. columns: of
    x, y, z on a line of text.
    """

    record_bytes: int
    offsets: tuple[int, ...]
    formats: tuple[str, ...]
    columns: tuple[int, ...]

    @property
    def single(self) -> bool:
        """True if x or y is a 32-bit floating point number."""
        return any(np.dtype(form).itemsize == 4 for form in self.formats[:2])

    @property
    def dtype(self) -> np.dtype[np.void]:
        """NumPy type of the record with x, y and z only."""
        return np.dtype(
            {
                "names": list("xyz"),
                "formats": self.formats,
                "offsets": self.offsets,
                "itemsize": self.record_bytes,
            }
        )


def layout_of(path: Path, fields: Iterable[tuple[str, str, int]]) -> RecordLayout:
    """Return the positions of x, y and z among fields of (name, NumPy type, count).

    Raises
    ------
    UsageError
        One is missing, given twice, no floating point number or more than one number.
    """
    found: dict[str, tuple[int, str, int]] = {}
    at = column = 0
    for spelt, form, count in fields:
        name = spelt.lower()
        size = np.dtype(form).itemsize
        if name in ("x", "y", "z"):
            if name in found:
                raise UsageError(f"{path}: its header is corrupt, it has {name} twice: copy it again")
            if count != 1 or np.dtype(form).kind != "f":
                many = "" if count == 1 else f"{count} of "
                raise UsageError(
                    f"{path}: its {name} is {many}{np.dtype(form).name}, not one floating point number"
                )
            found[name] = at, form, column
        at += size * count
        column += count
    missing = [name for name in "xyz" if name not in found]
    if missing:
        raise UsageError(f"{path}: its points have no {' and no '.join(missing)}")
    offsets, formats, columns = zip(*(found[name] for name in "xyz"), strict=True)
    return RecordLayout(at, offsets, formats, columns)


def from_records(
    file: BinaryIO, layout: RecordLayout, n_points: int, path: Path
) -> Iterator[NDArray[np.float64]]:
    """Read (n, 3) coordinates of records from the current position of the file, a million at a time."""
    left = n_points
    while left:
        n = min(left, CHUNK)
        data = file.read(n * layout.record_bytes)
        if len(data) < n * layout.record_bytes:
            raise truncated(path, n_points - left + len(data) // layout.record_bytes, n_points)
        yield stacked(np.frombuffer(data, layout.dtype))
        left -= n


def from_lines(
    lines: Iterator[str], columns: tuple[int, ...], separator: str | None, n_points: int, path: Path
) -> Iterator[NDArray[np.float64]]:
    """Read (n, columns) numbers from at most `n_points` lines of numbers, a million at a time.

    Empty lines are skipped. Raises `UsageError` with the first line that has no such numbers.
    """
    n = 0
    while n < n_points and (some := list(islice(lines, min(CHUNK, n_points - n)))):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # warns only if all lines are empty
            try:
                points = _numbers(some, columns, separator)
            except ValueError:
                some = [_NO_NUMBER.sub("nan", line) for line in some]
                try:
                    points = _numbers(some, columns, separator)
                except ValueError:
                    raise UsageError(_bad_line(path, some, columns, separator)) from None
        n += len(points)
        yield points.reshape(-1, len(columns))


def _numbers(lines: list[str], columns: tuple[int, ...], separator: str | None) -> NDArray[np.float64]:
    return np.loadtxt(lines, np.float64, None, separator, usecols=columns, ndmin=2, quotechar='"')


def header_line(file: BinaryIO, path: Path) -> bytes:
    """Read a line of a header.

    Raises
    ------
    UsageError
        Carriage returns alone end its lines.
    """
    line = file.readline(MOST_LINE)
    refuse_carriage_returns(line, path)
    return line


def refuse_carriage_returns(line: bytes, path: Path) -> None:
    """Refuse lines that end with a carriage return alone, as old Macintosh programs wrote them."""
    head, mark, _ = line.rstrip(b"\r\n").partition(b"\r")
    if mark and legible(head) is not None:
        raise UsageError(
            f"{path}: its lines end with carriage returns alone: write line feeds (as mac2unix does)"
        )


def legible(data: bytes) -> str | None:
    """Return ASCII bytes without control characters as text of at most 40 characters, else None."""
    text = " ".join(data.decode("ascii", "replace").split())
    return text[:40] if text.isascii() and text.isprintable() else None


def stacked(records: NDArray[np.void]) -> NDArray[np.float64]:
    """Return (n, 3) float64 coordinates from records with the fields x, y, z."""
    points = np.empty((len(records), 3))
    with np.errstate(invalid="ignore"):  # a signalling NaN raises the flag
        for k, name in enumerate("xyz"):
            points[:, k] = records[name]
    return points


def truncated(path: Path, n: int, n_points: int) -> UsageError:
    """Return the error for a file that holds fewer points than its header states."""
    return UsageError(f"{path}: it is truncated, {n} of {n_points} points: copy it again")


def _bad_line(path: Path, lines: list[str], columns: tuple[int, ...], separator: str | None) -> str:
    for line in lines:
        words = line.split(separator)
        if not line.strip():
            continue
        try:
            [float(words[k]) for k in columns]
        except (ValueError, IndexError):
            shown = " ".join(line.split())[:60]
            if not shown.isprintable() or "\ufffd" in shown:
                return f"{path}: it has bytes among its points that are no text: copy it again"
            return f"{path}: {shown!r} is no point of {max(columns) + 1} or more numbers: correct it"
    return f"{path}: its lines are not of numbers: correct them"
