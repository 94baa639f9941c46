"""Reader of stored clouds of any supported format; points stay in their own CRS."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from companion.desk.clouds import cloud_source
from companion.desk.clouds.cloud_source import NO_STEPS, Source, is_transient, unread
from companion.desk.clouds.crs import Reference, from_option
from companion.desk.clouds.las import open_las
from companion.desk.clouds.pcd import open_pcd
from companion.desk.clouds.ply import open_ply
from companion.desk.clouds.text import open_text
from companion.runtime.errors import UsageError

if TYPE_CHECKING:
    from slz import PointAttributes

Kind = Literal["las", "pcd", "ply", "text"]
HEAD = 512  # bytes
TEXT = frozenset({".xyz", ".txt", ".csv", ".asc"})
SUPPORTED = "LAS, LAZ, COPC, PCD, PLY, or text as .xyz, .txt or .csv"
_PCD_WORDS = (b"# .PCD", b"VERSION", b"FIELDS", b"COLUMNS")
_PLY_WORD = re.compile(rb"ply[ \t]*[\r\n]")
UTF_8_MARK = b"\xef\xbb\xbf"
_WIDE_MARKS = (b"\xff\xfe", b"\xfe\xff", b"\0\0\xfe\xff")  # of UTF-16 and UTF-32


@dataclass(frozen=True, slots=True)
class GeoreferencedCloud:
    """Points of one or more files.

    points: (n, 3) float64, x y z in the units of `reference`, finite. gps_s: (n,) float64, or None unless
    all files have times of one clock. dropped: points left out, by reason. coordinate_spacing: between
    neighbouring x or y coordinates, in CRS units, where a file holds 32-bit floating point numbers; 0 where
    none does. attributes: of the points, None where none was asked for or no file has any. scales: the
    coarsest of the files', see `Source`.
    """

    points: NDArray[np.float64]
    gps_s: NDArray[np.float64] | None
    reference: Reference
    n_read: int
    dropped: dict[str, int]
    coordinate_spacing: float = 0.0
    attributes: PointAttributes | None = None
    scales: tuple[float, float, float] = NO_STEPS


def read(
    files: Sequence[Path],
    crs: str | None = None,
    progress: Callable[[float], None] = lambda share: None,
    vertical_unit: str | None = None,
    with_attributes: bool = False,
) -> GeoreferencedCloud:
    """Read files of one CRS; their formats may differ.

    Parameters
    ----------
    files
        Paths; coordinates stay in the files' units.
    crs
        CRS that overrides the files'; PCD, PLY and text files state none and need it.
    progress
        Called with the share of points read.
    vertical_unit
        Unit of the heights, m, ft or us-ft; overrides the files'.
    with_attributes
        Keep intensity and return numbers.

    Raises
    ------
    UsageError
        A file is missing, empty, of no known format, truncated, corrupt, without CRS or of another CRS, or
        no point of it is usable.
    """
    from slz import PointAttributes
    from slz.window import join_attributes

    sources, skipped = open_clouds(files, crs, vertical_unit)
    if skipped:
        raise UsageError(skipped[0].reason)
    n_points = sum(source.n_points for source in sources)
    cloud_source.check_points(n_points)
    timed = sources[0].clock is not None and len({source.clock for source in sources}) == 1
    points = np.empty((n_points, 3))
    gps_s = np.empty(n_points) if timed else None
    dropped: Counter[str] = Counter()
    n_read = n = 0
    coordinate_spacing = 0.0
    attributes: list[PointAttributes] = []
    for source in sources:
        begin, read_before = n, n_read
        for chunk in source.chunks():
            n_read += chunk.n_read
            dropped.update(chunk.dropped)
            end = n + len(chunk.points)
            points[n:end] = chunk.points
            if gps_s is not None and chunk.gps_s is not None:
                gps_s[n:end] = chunk.gps_s
            if with_attributes:
                unknown = PointAttributes.unknown(len(chunk.points))
                attributes.append(unknown if chunk.attributes is None else chunk.attributes)
            n = end
            progress(min(n_read / n_points, 1.0))
        if n == begin:
            raise UsageError(
                f"{source.path}: none of its {n_read - read_before} points is usable{_reasons(dropped)}"
            )
        if source.single:
            coordinate_spacing = max(
                coordinate_spacing, float(np.spacing(np.float32(np.abs(points[begin:n, :2]).max())))
            )
    return GeoreferencedCloud(
        points[:n],
        None if gps_s is None else gps_s[:n],
        sources[0].reference,
        n_read,
        dict(dropped),
        coordinate_spacing,
        join_attributes(attributes) if any(map(_is_known, attributes)) else None,
        (
            max(source.scales[0] for source in sources),
            max(source.scales[1] for source in sources),
            max(source.scales[2] for source in sources),
        ),
    )


@dataclass(frozen=True, slots=True)
class Skipped:
    """A file that was left out, and the reason."""

    path: Path
    reason: str

    def document(self) -> dict[str, str]:
        return {"file": str(self.path), "reason": self.reason}


def open_clouds(
    files: Sequence[Path], crs: str | None, vertical_unit: str | None = None
) -> tuple[list[Source], list[Skipped]]:
    """Open clouds of one CRS; unusable files are left out if any other is usable.

    Raises
    ------
    UsageError
        No file can be used, one is absent or given twice, or their CRS differ.
    """
    if not files:
        raise UsageError("no files: name one or more clouds, such as .las, .laz, .pcd or .ply files")
    refuse_twice(files)
    given = from_option(crs, vertical_unit) if crs else None
    sources: list[Source] = []
    skipped: list[Skipped] = []
    for path in files:
        if not path.exists():
            raise UsageError(f"{path}: no such file")
        try:
            sources.append(open_source(path, given, vertical_unit))
        except UsageError as error:
            if len(files) == 1:
                raise
            skipped.append(Skipped(path, str(error)))
    if not sources:
        raise UsageError(f"none of {len(files)} files can be used: {skipped[0].reason}")
    refuse_mixed(sources)
    return sources, skipped


def open_source(path: Path, given: Reference | None, vertical_unit: str | None = None) -> Source:
    """Open a cloud of any format; `given` and `vertical_unit` are the user's CRS and unit of heights.

    Raises
    ------
    UsageError
        Its format is unknown, it cannot be used, or neither the file nor the user states its CRS.
    """
    kind = cloud_format_of(path)
    if kind == "las":
        return open_las(path, given, vertical_unit)
    if given is None:
        name = "text" if kind == "text" else f"a {kind.upper()} file"
        raise UsageError(f"{path}: {name} names no CRS: name it by --crs, such as --crs EPSG:2992")
    if kind == "pcd":
        return open_pcd(path, given)
    return open_ply(path, given) if kind == "ply" else open_text(path, given)


def refuse_twice(files: Sequence[Path]) -> None:
    """Refuse a file that is listed twice, since its points would count twice."""
    seen: set[Path] = set()
    for path in files:
        real = path.resolve()
        if real in seen:
            raise UsageError(f"{path}: it is given twice: name every file once")
        seen.add(real)


def refuse_mixed(sources: Sequence[Source]) -> None:
    """Refuse files of different CRS, or of different vertical datums where they state them."""
    first = next((source for source in sources if source.reference.vertical is not None), sources[0])
    for source in sources:
        if not source.reference.same_as(first.reference):
            raise UsageError(
                f"{source.path}: its CRS {source.reference.name} differs from {first.reference.name} of"
                f" {first.path}: reproject one of them"
            )


def _is_known(attributes: PointAttributes) -> bool:
    return bool(attributes.echoes.any() or not np.isnan(attributes.intensity).all())


def _reasons(dropped: Counter[str]) -> str:
    counts = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in dropped.items() if count)
    return f" ({counts})" if counts else ""


def cloud_format_of(path: Path) -> Kind:
    """Return the format of a file.

    Raises
    ------
    UsageError
        Missing, unreadable, empty or of no supported format.
    """
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise UsageError(f"{path}: it is a folder: name the clouds in it, such as {path / '*.laz'}") from None
    except OSError as error:
        if is_transient(error):
            raise unread(path, error) from None
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    if not head:
        raise UsageError(f"{path}: it is empty")
    suffix = path.suffix.lower()
    if head.startswith(b"LASF"):
        return "las"
    head = head.removeprefix(UTF_8_MARK)
    if _PLY_WORD.match(head):
        return "ply"
    if head.startswith(_PCD_WORDS) or (suffix == ".pcd" and not _is_wide(head)):
        return "pcd"
    if _is_wide(head):
        raise UsageError(f"{path}: it is text in UTF-16, as PowerShell writes it: save it as UTF-8")
    if suffix in (".las", ".laz"):
        raise UsageError(f"{path}: it is not a LAS or LAZ file, whatever its name says")
    if suffix == ".ply":
        raise UsageError(f"{path}: it is not a PLY file, whatever its name says")
    if suffix in TEXT:
        return "text"
    raise UsageError(f"{path}: it is not a cloud of a kind that is supported: {SUPPORTED}")


def _is_wide(head: bytes) -> bool:
    """Return whether a file begins as text of two or four bytes a character."""
    if head.startswith(_WIDE_MARKS):
        return True
    even, odd = head[::2], head[1::2]
    return len(odd) > 1 and ((not any(odd) and all(even)) or (not any(even) and all(odd)))
