"""What every kind of stored cloud gives: how many points, of which CRS, and the points, piece by piece."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from companion.desk.clouds.crs import Reference
from companion.runtime.errors import CompanionError, UsageError
from companion.runtime.interrupt import Interrupted

CHUNK = 1_000_000  # points
# What the system says of a name, or of an offset that a corrupt header tells: it says so again next time.
LASTING = frozenset(
    {errno.ENOENT, errno.EACCES, errno.EPERM, errno.EISDIR, errno.ENOTDIR, errno.EINVAL, errno.EOVERFLOW}
)
LAZ_UNREAD = "IoError: Failed to use read"  # what lazrs makes of any error of the file it reads from
Clock = Literal["week", "standard"]  # of GPS: since the week's beginning, or since 1980 less 1e9 s


@dataclass(frozen=True, slots=True)
class Chunk:
    """A piece of a file.

    points : (n, 3) float64, those to use, finite. gps_s : (n,) float64, their times, or None without a clock.
    n_read: points of the piece, with those left out. dropped: the latter by reason.
    """

    points: NDArray[np.float64]
    gps_s: NDArray[np.float64] | None
    n_read: int
    dropped: dict[str, int]


class Source(Protocol):
    """An opened cloud whose header makes sense."""

    @property
    def path(self) -> Path: ...

    @property
    def n_points(self) -> int:
        """Points in the file; of text, the most there can be."""

    @property
    def reference(self) -> Reference: ...

    @property
    def clock(self) -> Clock | None: ...

    @property
    def single(self) -> bool:
        """Whether coordinates are 32-bit floating point numbers."""

    def chunks(self) -> Iterator[Chunk]:
        """Read the points.

        Raises
        ------
        UsageError
            The file is truncated or corrupt.
        """


def finite(points: NDArray[np.float64]) -> Chunk:
    """Return a piece of points without clock or classes, those with NaN or infinity dropped and counted."""
    keep = np.isfinite(points).all(axis=1)
    n_bad = int(len(points) - keep.sum())
    return Chunk(points if not n_bad else points[keep], None, len(points), {"not_finite": n_bad})


def corrupt(path: Path, reason: str) -> UsageError:
    """Return the refusal of a file that cannot be decoded."""
    return UsageError(f"{path}: it is truncated or corrupt ({reason}): copy it again")


def reason_of(error: BaseException) -> str:
    """Return what a decoder raised in one short line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:160]


def passing(error: BaseException) -> bool:
    """Tell whether an error says nothing of the file: the disk, the network or memory failed."""
    if isinstance(error, OSError):
        return error.errno is not None and error.errno not in LASTING
    return isinstance(error, MemoryError) or LAZ_UNREAD in str(error)


def unread(path: Path, error: BaseException) -> CompanionError:
    """Return the end of a survey for a file that may be good: no UsageError, for which it is left out."""
    return CompanionError(f"{path}: reading it failed ({reason_of(error)}): run again to go on")


@contextmanager
def translated(path: Path) -> Iterator[None]:
    """Turn whatever decoders raise, Rust's panics included, into one line."""
    try:
        yield
    except (CompanionError, Interrupted, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:
        if passing(error):
            raise unread(path, error) from None
        raise corrupt(path, reason_of(error)) from None
