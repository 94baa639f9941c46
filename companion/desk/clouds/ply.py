"""Reader of PLY files (Stanford polygon format), ascii and binary of either byte order: their vertices."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np

from companion.desk.clouds.cloud_source import NO_STEPS, Chunk, finite, translated
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

FORMATS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
    "int64": "i8", "uint64": "u8",  # beyond the format, as programs write times
}  # fmt: skip


@dataclass(slots=True)
class _Element:
    name: str
    count: int
    fields: list[tuple[str, str, int]] = field(default_factory=list)
    has_list: bool = False

    @property
    def stride(self) -> int:
        return sum(np.dtype(form).itemsize for _, form, _ in self.fields)


@dataclass(frozen=True, slots=True)
class PlySource:
    """A PLY file, see `Source`. start: offset of the vertices; for text, before the lines to skip."""

    path: Path
    n_points: int
    reference: Reference
    layout: RecordLayout
    is_text: bool
    start: int
    skipped_lines: int
    clock: None = None
    scales: tuple[float, float, float] = NO_STEPS

    @property
    def single(self) -> bool:
        return self.layout.single

    def chunks(self) -> Iterator[Chunk]:
        with translated(self.path), self.path.open("rb") as file:
            file.seek(self.start)
            if not self.is_text:
                for points in from_records(file, self.layout, self.n_points, self.path):
                    yield finite(points)
                return
            n = 0
            lines = (line.decode("ascii", "replace") for line in file)
            vertices = islice(lines, self.skipped_lines, self.skipped_lines + self.n_points)
            for points in from_lines(vertices, self.layout.columns, None, self.n_points, self.path):
                n += len(points)
                yield finite(points)
            if n < self.n_points:
                raise truncated(self.path, n, self.n_points)


def open_ply(path: Path, reference: Reference) -> PlySource:
    """Read and check the header of a PLY file.

    Raises
    ------
    UsageError
        The file is truncated, corrupt or without vertices of floating point x, y, z.
    """
    with translated(path), path.open("rb") as file:
        form, elements = _header(file, path)
        start, size = file.tell(), path.stat().st_size
        before = []
        for element in elements:
            if element.name == "vertex":
                break
            before.append(element)
        else:
            raise UsageError(f"{path}: it has no vertices")
        lists = [part.name for part in (*before, element) if part.has_list]
        if lists and (element.has_list or form != "ascii"):
            raise UsageError(
                f"{path}: its {lists[0]} has a list before or among the points: write them alone"
            )
        layout = layout_of(path, element.fields)
        is_text = form == "ascii"
        lines = sum(part.count for part in before)
        if is_text:
            least = start + 2 * (len(element.fields) * element.count + lines) - 1
        else:
            start += sum(part.stride * part.count for part in before)
            least = start + layout.record_bytes * element.count
        if size < least:
            raise UsageError(
                f"{path}: it is truncated, {size} bytes where its header asks for {least}: copy it again"
            )
        if not is_text and element is elements[-1]:
            check_none_follow(path, element.count, (size - least) // layout.record_bytes)
        if not element.count:
            raise UsageError(f"{path}: it holds no points")
        return PlySource(path, element.count, reference, layout, is_text, start, lines if is_text else 0)


def _header(file: BinaryIO, path: Path) -> tuple[str, list[_Element]]:
    form, elements = "", list[_Element]()
    header_line(file, path)
    while True:
        line = header_line(file, path)
        if not line.endswith(b"\n") or file.tell() > MOST_HEADER:
            raise UsageError(f"{path}: it is truncated or corrupt within its header: copy it again")
        match line.decode("ascii", "replace").split():
            case ["end_header"]:
                break
            case ["format", name, "1.0"] if name in FORMATS and not form:
                form = name
            case ["comment" | "obj_info", *_]:
                pass
            case ["element", name, count] if count.isascii() and count.isdigit() and len(count) < 15:
                elements.append(_Element(name, int(count)))
            case ["property", "list", counted, kind, _] if elements and counted in TYPES and kind in TYPES:
                elements[-1].has_list = True
            case ["property", kind, name] if elements and form and kind in TYPES:
                elements[-1].fields.append((name, FORMATS[form] + TYPES[kind], 1))
            case _:
                shown = legible(line)
                what = "it has bytes that are no text" if shown is None else f"{shown!r} is not known"
                raise UsageError(f"{path}: its header is corrupt, {what}: copy it again")
    if not form:
        raise UsageError(f"{path}: its header is corrupt, it names no format: copy it again")
    return form, elements
