"""Stored clouds: LAS and LAZ files in, points in their own CRS out."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from numpy.typing import NDArray

from companion.errors import UsageError
from companion.interrupt import Interrupted
from companion.survey import memory
from companion.survey.reference import Reference, from_option, of_header
from companion.survey.signature import look

CHUNK = 1_000_000
# ASPRS classes. Noise is no ground. Water is: but nothing can land on it, so it must stay unseen.
LOW_NOISE, HIGH_NOISE, WATER = 7, 18, 9


@dataclass(frozen=True, slots=True)
class Cloud:
    """Points of one or more files.

    points : (n, 3) float64, x y z in the units of `reference`, finite. gps_s : (n,) float64 or None where
    a file has no usable time. dropped: points left out, by reason.
    """

    points: NDArray[np.float64]
    gps_s: NDArray[np.float64] | None
    reference: Reference
    n_read: int
    dropped: dict[str, int]


@dataclass(frozen=True, slots=True)
class _Header:
    path: Path
    n_points: int
    reference: Reference
    has_time: bool
    standard_time: bool


def read(
    files: Sequence[Path], crs: str | None = None, progress: Callable[[float], None] = lambda share: None
) -> Cloud:
    """Read LAS or LAZ files of one CRS.

    Parameters
    ----------
    files
        Paths; coordinates stay in the files' units.
    crs
        Overrides what the files say.
    progress
        Called with the share of points read.

    Raises
    ------
    UsageError
        A file is missing, empty, not LAS, truncated, corrupt, without CRS or of another CRS, or no point
        of it is usable.
    """
    if not files:
        raise UsageError("no files: name one or more .las or .laz files")
    _refuse_twice(files)
    given = from_option(crs) if crs else None
    headers = [_header(path, given) for path in files]
    for header in headers[1:]:
        if not header.reference.same_as(headers[0].reference):
            raise UsageError(
                f"{header.path}: its CRS {header.reference.name} differs from {headers[0].reference.name} of"
                f" {headers[0].path}: reproject one of them"
            )
    n_points = sum(header.n_points for header in headers)
    memory.check_points(n_points)
    timed = all(header.has_time for header in headers) and len({h.standard_time for h in headers}) == 1
    points = np.empty((n_points, 3))
    gps_s = np.empty(n_points) if timed else None
    dropped: Counter[str] = Counter()
    n_read = n = 0
    for header in headers:
        before = n
        for chunk in _chunks(header):
            n_read += len(chunk)
            xyz, keep = _usable(chunk, dropped)
            points[n : n + len(xyz)] = xyz
            if gps_s is not None:
                gps_s[n : n + len(xyz)] = np.asarray(chunk.gps_time)[keep]
            n += len(xyz)
            progress(n_read / n_points)
        if n == before:
            raise UsageError(
                f"{header.path}: none of its {header.n_points} points is usable{_reasons(dropped)}"
            )
    return Cloud(
        points[:n], None if gps_s is None else gps_s[:n], headers[0].reference, n_read, dict(dropped)
    )


def _refuse_twice(files: Sequence[Path]) -> None:
    """Refuse a file that is named twice: its points would count twice."""
    seen: set[Path] = set()
    for path in files:
        real = path.resolve()
        if real in seen:
            raise UsageError(f"{path}: it is given twice: name every file once")
        seen.add(real)


def _header(path: Path, given: Reference | None) -> _Header:
    look(path)
    with _translated(path), laspy.open(path, encoding_errors="replace") as reader:
        header = reader.header
        n_points = int(header.point_count)
        names = set(header.point_format.dimension_names)
        standard = bool(header.global_encoding.gps_time_type)
        if not n_points:
            raise UsageError(f"{path}: it holds no points")
        scales = [float(scale) for scale in header.scales]
        if not all(math.isfinite(scale) and scale != 0 for scale in scales):
            told = ", ".join(f"{scale:g}" for scale in scales)
            raise UsageError(f"{path}: its header is corrupt, its scales are {told}: copy it again")
        size, least = path.stat().st_size, int(header.offset_to_point_data)
        if not header.are_points_compressed:
            least += n_points * int(header.point_format.size)
        if size < least:
            raise UsageError(
                f"{path}: it is truncated, {size} bytes where its header asks for {least}: copy it again"
            )
        return _Header(path, n_points, given or of_header(header, path), "gps_time" in names, standard)


def _chunks(header: _Header) -> Iterator[Any]:
    n = 0
    with _translated(header.path), laspy.open(header.path, encoding_errors="replace") as reader:
        for chunk in reader.chunk_iterator(CHUNK):
            n += len(chunk)
            yield chunk
    if n != header.n_points:
        raise UsageError(f"{header.path}: it is truncated, {n} of {header.n_points} points: copy it again")


def _usable(chunk: Any, dropped: Counter[str]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return coordinates of the points to use, and which of the chunk they are; count the others."""
    with np.errstate(invalid="ignore", over="ignore"):
        xyz = np.column_stack([np.asarray(chunk[axis], np.float64) for axis in "xyz"])
    kind = np.asarray(chunk.classification)
    keep = np.ones(len(xyz), bool)
    for reason, bad in (
        ("withheld", np.asarray(chunk.withheld) != 0),
        ("noise", (kind == LOW_NOISE) | (kind == HIGH_NOISE)),
        ("water", kind == WATER),
        ("not_finite", ~np.isfinite(xyz).all(axis=1)),
    ):
        dropped[reason] += int((keep & bad).sum())
        keep &= ~bad
    return xyz[keep], keep


def _reasons(dropped: Counter[str]) -> str:
    counts = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in dropped.items() if count)
    return f" ({counts})" if counts else ""


@contextmanager
def _translated(path: Path) -> Iterator[None]:
    """Turn whatever the decoders raise, Rust's panics included, into one line."""
    try:
        yield
    except (UsageError, Interrupted, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:160]
        raise UsageError(f"{path}: it is truncated or corrupt ({reason}): copy it again") from None
