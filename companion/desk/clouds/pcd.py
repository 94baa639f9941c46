"""Reader of PCD files of the Point Cloud Library: ascii, binary and binary_compressed (PCD .5 to 0.7).

A text header up to DATA, then lines of numbers, records, or one LZF block that holds the points field by
field; where that would not be smaller, pypcd stores the block as it is. VIEWPOINT is the sensor's pose: PCL
takes it for the transformation of points in the sensor's frame (pcl_viewer, pcl_transform_from_viewpoint,
pcl_ros) and for the place of the sensor among points of the same frame (normals), so no reader can apply it.
In the first versions SIZE, TYPE, COUNT, WIDTH and HEIGHT may be missing.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import compress
from pathlib import Path
from typing import Any, BinaryIO

import lzf
import numpy as np
from numpy.typing import NDArray

from companion.desk.clouds import cloud_source
from companion.desk.clouds.cloud_source import CHUNK, NO_STEPS, Chunk, finite, translated
from companion.desk.clouds.crs import Reference
from companion.desk.clouds.laz_chunks import check_none_follow
from companion.desk.clouds.records import (
    MOST_HEADER,
    RecordLayout,
    from_lines,
    from_records,
    header_line,
    layout_of,
    legible,
    truncated,
)
from companion.runtime.errors import UsageError

WORDS = frozenset(
    [
        "VERSION",
        "FIELDS",
        "COLUMNS",
        "SIZE",
        "TYPE",
        "COUNT",
        "WIDTH",
        "HEIGHT",
        "VIEWPOINT",
        "POINTS",
        "DATA",
    ]
)
BOOL = ("B", 1)
TYPES = {("F", 4), ("F", 8), BOOL} | {(kind, size) for kind in "IU" for size in (1, 2, 4, 8)}
MOST_COUNT = 1 << 20  # numbers in a field
MOST_RATIO = 100  # of LZF, where three bytes become at most 264
PADDING = "_"
IDENTITY = "0 0 0 1 0 0 0"  # VIEWPOINT: x y z, and quaternion w x y z
SIX_DIGITS = 1e-6  # relative precision of a pose written as text


@dataclass(frozen=True, slots=True)
class Field:
    """A field with one number per point.

    form: NumPy type. offset: in the record, in bytes. column: on a line of text.
    """

    name: str
    form: str
    offset: int
    column: int


@dataclass(frozen=True, slots=True)
class PcdSource:
    """A PCD file, see `Source`.

    data: its encoding, as in the header. start: offset of the points. fields: those of one number, in lower
    case; of equal names the first.
    """

    path: Path
    n_points: int
    reference: Reference
    layout: RecordLayout
    data: str
    start: int
    fields: tuple[Field, ...] = ()
    clock: None = None
    scales: tuple[float, float, float] = NO_STEPS

    @property
    def single(self) -> bool:
        return self.layout.single

    def chunks(self) -> Iterator[Chunk]:
        with translated(self.path), self.path.open("rb") as file:
            file.seek(self.start)
            if self.data == "ascii":
                yield from map(finite, self._rows(file, self.layout.columns))
            elif self.data == "binary":
                for points in from_records(file, self.layout, self.n_points, self.path):
                    yield finite(points)
            else:
                yield from self._unpacked(file)

    def records(self) -> NDArray[np.void]:
        """Return all points with all fields of one number, (n,) records; from text all are float64.

        Raises
        ------
        UsageError
            The file is truncated or corrupt.
        """
        names = [field.name for field in self.fields]
        with translated(self.path), self.path.open("rb") as file:
            file.seek(self.start)
            if self.data == "ascii":
                rows = list(self._rows(file, tuple(field.column for field in self.fields)))
                return _table(names, list(np.concatenate(rows).T))
            if self.data == "binary":
                offsets, forms = (
                    [field.offset for field in self.fields],
                    [field.form for field in self.fields],
                )
                whole = np.dtype(
                    {
                        "names": names,
                        "formats": forms,
                        "offsets": offsets,
                        "itemsize": self.layout.record_bytes,
                    }
                )
                data = file.read(self.n_points * self.layout.record_bytes)
                if len(data) < self.n_points * self.layout.record_bytes:
                    raise truncated(self.path, len(data) // self.layout.record_bytes, self.n_points)
                return np.frombuffer(data, whole)
            plain = self._plain(file)
            return _table(names, [self._axis(plain, field.offset, field.form) for field in self.fields])

    def _rows(self, file: BinaryIO, columns: tuple[int, ...]) -> Iterator[NDArray[np.float64]]:
        """Yield (n, columns) numbers of the lines."""
        n = 0
        lines = (line.decode("ascii", "replace") for line in file)
        for rows in from_lines(lines, columns, None, self.n_points, self.path):
            n += len(rows)
            yield rows
        if n < self.n_points:
            raise truncated(self.path, n, self.n_points)
        check_none_follow(self.path, n, sum(bool(line.strip(" \r\n\t\0\x1a")) for line in lines))

    def _unpacked(self, file: BinaryIO) -> Iterator[Chunk]:
        plain = self._plain(file)
        axes = [
            self._axis(plain, at, form)
            for at, form in zip(self.layout.offsets, self.layout.formats, strict=True)
        ]
        for begin in range(0, self.n_points, CHUNK):
            yield finite(_columns([axis[begin : begin + CHUNK] for axis in axes]))

    def _axis(self, plain: NDArray[np.uint8], offset: int, form: str) -> NDArray[Any]:
        """Return a field of all points from the field-by-field layout of binary_compressed."""
        size = self.n_points * np.dtype(form).itemsize
        return plain[offset * self.n_points :][:size].view(form)

    def _plain(self, file: BinaryIO) -> NDArray[np.uint8]:
        """Return the decompressed points of binary_compressed."""
        head = file.read(8)
        if len(head) < 8:
            raise truncated(self.path, 0, self.n_points)
        packed_bytes, plain_bytes = struct.unpack("<II", head)
        packed = file.read(packed_bytes)
        if len(packed) < packed_bytes:
            raise truncated(self.path, 0, self.n_points)
        if packed_bytes == plain_bytes == self.n_points * self.layout.record_bytes:
            return np.frombuffer(packed, np.uint8)
        if plain_bytes != self.n_points * self.layout.record_bytes or plain_bytes > packed_bytes * MOST_RATIO:
            raise UsageError(f"{self.path}: it is corrupt, its sizes contradict each other: copy it again")
        cloud_source.check_bytes(plain_bytes, self.path)
        try:
            plain = lzf.decompress(packed, plain_bytes)
        except ValueError:
            plain = None
        if plain is None or len(plain) < plain_bytes:
            raise UsageError(f"{self.path}: it is corrupt, its points cannot be unpacked: copy it again")
        return np.frombuffer(plain, np.uint8)


def open_pcd(path: Path, reference: Reference, in_sensor_axes: bool = False) -> PcdSource:
    """Read and check the header of a PCD file.

    Parameters
    ----------
    in_sensor_axes
        Its points are in the sensor's axes, whatever its VIEWPOINT; else that must be the identity.

    Raises
    ------
    UsageError
        The file is truncated, corrupt, without floating point x, y, z, or its VIEWPOINT moves or turns them.
    """
    with translated(path), path.open("rb") as file:
        words = _header(file, path)
        start, size = file.tell(), path.stat().st_size
        names = words.get("FIELDS") or words.get("COLUMNS") or []
        data = " ".join(words["DATA"]).lower()
        default = [4] * len(names) if data == "ascii" else []  # separators end a field
        sizes = _numbers(words, "SIZE", path, default)
        kinds = [kind.upper() for kind in words.get("TYPE", ["F"] * len(default))]
        counts = _numbers(words, "COUNT", path, [1] * len(names))
        if not names or not len(names) == len(kinds) == len(sizes) == len(counts):
            raise _corrupt(path, "FIELDS, SIZE, TYPE and COUNT differ in length")
        if not all(0 < count <= MOST_COUNT for count in counts):
            raise _corrupt(path, f"a COUNT is not from 1 to {MOST_COUNT}")
        unknown = [f"{t}{s}" for t, s in zip(kinds, sizes, strict=True) if (t, s) not in TYPES]
        if unknown:
            raise _corrupt(path, f"{unknown[0]!r} is no type")
        forms = [
            "<u1" if (kind, size) == BOOL else f"<{kind.lower()}{size}"
            for kind, size in zip(kinds, sizes, strict=True)
        ]
        n_points = _count(words, path)
        if data == "binary_compressed" and _omits_padding(file, names, forms, counts, n_points):
            kept = [name != PADDING for name in names]
            names, forms = list(compress(names, kept)), list(compress(forms, kept))
            counts = list(compress(counts, kept))
        layout = layout_of(path, zip(names, forms, counts, strict=True))
        if not in_sensor_axes:
            _refuse_pose(words, path)
        if data not in ("ascii", "binary", "binary_compressed"):
            raise _corrupt(path, f"DATA {data[:40]!r} is not known")
        least = {"ascii": 2 * sum(counts) * n_points, "binary": layout.record_bytes * n_points}.get(data, 8)
        if size - start < least - 1:  # the last line may lack its end
            raise UsageError(
                f"{path}: it is truncated, {size} bytes where its header asks for {start + least}:"
                " copy it again"
            )
        if data == "binary":
            check_none_follow(path, n_points, _filled(file, start + least, layout.record_bytes))
        if not n_points:
            raise UsageError(f"{path}: it holds no points")
        fields = _fields(names, forms, counts)
        return PcdSource(path, n_points, reference, layout, data, start, fields)


def _header(file: BinaryIO, path: Path) -> dict[str, list[str]]:
    words: dict[str, list[str]] = {}
    while "DATA" not in words:
        line = header_line(file, path).removeprefix(b"\xef\xbb\xbf")
        if not line.endswith(b"\n") or file.tell() > MOST_HEADER:
            raise UsageError(f"{path}: it is no PCD file, or truncated within its header")
        first, *rest = line.decode("ascii", "replace").split() or ["#"]
        if first.startswith("#"):
            continue
        first = first.upper()
        if first not in WORDS:
            shown = legible(line)
            raise _corrupt(
                path, "it has bytes that are no text" if shown is None else f"{shown!r} is not known"
            )
        if first in words:
            raise _corrupt(path, f"{first} is twice")
        words[first] = rest
    return words


def _count(words: dict[str, list[str]], path: Path) -> int:
    """Return the number of points; WIDTH and HEIGHT must agree with POINTS."""
    (stated,) = _numbers(words, "POINTS", path, [-1])[:1] or [-1]
    (height,) = _numbers(words, "HEIGHT", path, [1])[:1] or [-1]
    (width,) = _numbers(words, "WIDTH", path, [stated if height == 1 else -1])[:1] or [-1]
    points = stated if "POINTS" in words else width * height
    if width < 0 or height < 0 or points != width * height:
        raise _corrupt(path, "WIDTH, HEIGHT and POINTS contradict each other")
    return points


def _refuse_pose(words: dict[str, list[str]], path: Path) -> None:
    """Refuse a VIEWPOINT other than the identity; a quaternion of zeros is no rotation."""
    pose = words.get("VIEWPOINT", IDENTITY.split())
    try:
        x, y, z, w, *turn = map(float, pose[:7])
    except ValueError:
        turn = []
    if len(turn) != 3:
        raise _corrupt(path, "VIEWPOINT is not seven numbers")
    half_turn = math.hypot(*turn) / (math.hypot(w, *turn) or 1.0)  # sine of half the angle
    if not all(abs(number) <= SIX_DIGITS for number in (x, y, z, half_turn)):
        raise UsageError(
            f"{path}: its VIEWPOINT {' '.join(pose[:7])[:60]} is a pose of the sensor, and its points may be"
            " in the sensor's axes or placed already: apply it (pcl_transform_from_viewpoint) or write"
            f" {IDENTITY}"
        )


def _omits_padding(
    file: BinaryIO, names: list[str], forms: list[str], counts: list[int], n_points: int
) -> bool:
    """Return whether a compressed block, which begins here, lacks the padding, as PCL has it."""
    start = file.tell()
    head = file.read(8)
    file.seek(start)
    sizes = [np.dtype(form).itemsize * count for form, count in zip(forms, counts, strict=True)]
    dense = sum(size for name, size in zip(names, sizes, strict=True) if name != PADDING)
    return dense < sum(sizes) and head[4:] == struct.pack("<I", dense * n_points)


def _filled(file: BinaryIO, end: int, record_bytes: int) -> int:
    """Return the number of whole records behind the last point, 0 if they are padding."""
    file.seek(0, 2)
    size = file.tell()
    file.seek(end)
    return (size - end) // record_bytes if any(file.read(record_bytes)) else 0


def _numbers(words: dict[str, list[str]], name: str, path: Path, default: list[int]) -> list[int]:
    try:
        return [int(word) for word in words[name]] if name in words else default
    except ValueError:
        raise _corrupt(path, f"{name} is no number") from None


def _corrupt(path: Path, why: str) -> UsageError:
    return UsageError(f"{path}: its header is corrupt, {why}: copy it again")


def _fields(names: list[str], forms: list[str], counts: list[int]) -> tuple[Field, ...]:
    found: dict[str, Field] = {}
    offset = column = 0
    for name, form, count in zip(names, forms, counts, strict=True):
        if count == 1:
            found.setdefault(name.lower(), Field(name.lower(), form, offset, column))
        offset += np.dtype(form).itemsize * count
        column += count
    return tuple(found.values())


def _table(names: list[str], columns: list[NDArray[Any]]) -> NDArray[np.void]:
    kinds = [(name, column.dtype) for name, column in zip(names, columns, strict=True)]
    table = np.empty(len(columns[0]), kinds)
    for name, column in zip(names, columns, strict=True):
        table[name] = column
    return table


def _columns(axes: list[NDArray[np.floating]]) -> NDArray[np.float64]:
    with np.errstate(invalid="ignore"):
        return np.column_stack([axis.astype(np.float64) for axis in axes])
