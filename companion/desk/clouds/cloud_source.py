"""Common interface of stored clouds: number of points, CRS, and chunked reading; translation of errors."""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from companion.desk.clouds.crs import Reference
from companion.runtime.errors import CompanionError, UsageError
from companion.runtime.interrupt import Interrupted

if TYPE_CHECKING:
    from slz import PointAttributes

SHARE = 0.7  # of the machine's memory
MOST_CELLS = 200_000_000
POINT_BYTES = 130  # per point at the peak of a survey, measured
BOX_BYTES = 160  # per cell of the cloud's extent, measured
SQUARE_BYTES = 64  # per cell of the square around it: the largest array, whose unused pages take no memory

CHUNK = 1_000_000  # points
NO_STEPS = (0.0, 0.0, 0.0)
# Errors due to a file's name, or to an offset in a corrupt header: they would occur again.
LASTING = frozenset(
    {errno.ENOENT, errno.EACCES, errno.EPERM, errno.EISDIR, errno.ENOTDIR, errno.EINVAL, errno.EOVERFLOW}
)
LAZ_UNREAD = "IoError: Failed to use read"  # lazrs reports any read error of its file so
Clock = Literal["week", "standard"]  # GPS time: since the beginning of the week, or since 1980 less 1e9 s


@dataclass(frozen=True, slots=True)
class Chunk:
    """Points of a part of a file.

    points: (n, 3) float64, those to use, finite. gps_s: (n,) float64, their times, or None without a clock.
    n_read: points of the part, including those left out. dropped: number left out, by reason.
    attributes: of the points to use, None where the format gives none.
    """

    points: NDArray[np.float64]
    gps_s: NDArray[np.float64] | None
    n_read: int
    dropped: dict[str, int]
    attributes: PointAttributes | None = None


class Source(Protocol):
    """Opened cloud with a valid header."""

    @property
    def path(self) -> Path: ...

    @property
    def n_points(self) -> int:
        """Points in the file; for text, an upper bound."""

    @property
    def reference(self) -> Reference: ...

    @property
    def clock(self) -> Clock | None: ...

    @property
    def single(self) -> bool:
        """True if coordinates are 32-bit floating point numbers."""

    @property
    def scales(self) -> tuple[float, float, float]:
        """Steps of x, y and z, in units of the CRS; 0 for floating point numbers."""

    def chunks(self) -> Iterator[Chunk]:
        """Read the points.

        Raises
        ------
        UsageError
            The file is truncated or corrupt.
        """


def finite(points: NDArray[np.float64]) -> Chunk:
    """Return a chunk without clock or classes; points with NaN or infinity are dropped and counted."""
    keep = np.isfinite(points).all(axis=1)
    n_bad = int(len(points) - keep.sum())
    return Chunk(points if not n_bad else points[keep], None, len(points), {"not_finite": n_bad})


def corrupt(path: Path, reason: str) -> UsageError:
    """Return the error for a file that cannot be decoded."""
    return UsageError(f"{path}: it is truncated or corrupt ({reason}): copy it again")


def reason_of(error: BaseException) -> str:
    """Return a decoder's exception in one short line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:160]


def is_transient(error: BaseException) -> bool:
    """Return whether an error is transient: the disk, the network or memory failed, not the file."""
    if isinstance(error, OSError):
        return error.errno is not None and error.errno not in LASTING
    return isinstance(error, MemoryError) or LAZ_UNREAD in str(error)


def unread(path: Path, error: BaseException) -> CompanionError:
    """Return the error that ends a survey for a file that may be valid; a UsageError would leave it out."""
    return CompanionError(f"{path}: reading it failed ({reason_of(error)}): run again to go on")


@contextmanager
def translated(path: Path) -> Iterator[None]:
    """Translate any exception of decoders, including Rust's panics, into a one-line error."""
    try:
        yield
    except (CompanionError, Interrupted, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:
        if is_transient(error):
            raise unread(path, error) from None
        raise corrupt(path, reason_of(error)) from None


def total_bytes() -> int:
    """Return the machine's physical memory."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def check_points(n_points: int) -> None:
    """Refuse more points than fit."""
    most = int(SHARE * total_bytes() / POINT_BYTES)
    if n_points > most:
        raise UsageError(
            f"{n_points} points do not fit into memory, {most} would: map fewer files at a time, or thin them"
        )


def check_bytes(n_bytes: int, path: Path) -> None:
    """Refuse a file with a part that must be held at once and does not fit."""
    most = int(SHARE * total_bytes())
    if n_bytes > most:
        raise UsageError(f"{path}: its {n_bytes} bytes do not fit into memory, {most} would: split it")


def check_cells(width_m: float, height_m: float, cell_m: float, n_points: int) -> None:
    """Refuse a grid that does not fit beside the points; the error names a cell size that would."""
    box = width_m * height_m / cell_m**2
    square = (max(width_m, height_m) / cell_m) ** 2
    memory = total_bytes()
    room = max(SHARE * memory - n_points * POINT_BYTES, 0.05 * memory)
    excess = max(box / MOST_CELLS, box * BOX_BYTES / room, square * SQUARE_BYTES / (0.9 * memory))
    if excess > 1:
        fits = math.ceil(cell_m * math.sqrt(excess) * 1.01 * 100) / 100
        raise UsageError(
            f"{width_m:.0f} m x {height_m:.0f} m are too many cells of {cell_m:g} m:"
            f" --cell-m {fits:g} would do, or map fewer files at a time"
        )
