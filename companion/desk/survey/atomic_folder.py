"""Output folder of a survey: exclusive lock, all-or-nothing results, and a work folder for resuming."""

from __future__ import annotations

import fcntl
import logging
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from companion.runtime.errors import UsageError
from companion.runtime.interrupt import Interrupted

log = logging.getLogger(__name__)

WORK = ".slz-survey"
WORTH_BYTES = 200_000_000  # of finished work; less is faster to repeat than to explain to the user


def check_output_path(out: Path) -> None:
    """Refuse an output path that is a file, before minutes are spent; the folder itself is made later."""
    there = next(part for part in (out, *out.parents) if part.exists())
    if not there.is_dir():
        raise UsageError(f"--out {out}: {there} is a file: name a folder")


@contextmanager
def locked_folder(out: Path) -> Iterator[None]:
    """Make a folder and lock it against other runs; remove the folders made here if they end up empty.

    Raises
    ------
    UsageError
        Another run writes to it.
    """
    made = [part for part in (out, *out.parents) if not part.exists()]
    out.mkdir(parents=True, exist_ok=True)
    folder = os.open(out, os.O_RDONLY)
    try:
        _lock(folder, out)
        yield
    finally:
        os.close(folder)  # releases the lock; the end of the process would, too
        for part in made:
            with suppress(OSError):  # it holds results
                part.rmdir()


def _lock(folder: int, out: Path) -> None:
    try:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise UsageError(f"--out {out}: another run writes to it: wait for it, or name another") from None
    except OSError as error:  # the file system has no locks
        log.debug("no lock on %s: %s", out, error)


@contextmanager
def temporary_folder(out: Path) -> Iterator[Path]:
    """Yield a temporary folder within `out` for incomplete results; it is removed at the end."""
    with tempfile.TemporaryDirectory(prefix=".slz-map-", dir=out, ignore_cleanup_errors=True) as folder:
        yield Path(folder)


def finish(written: list[Path], out: Path) -> list[Path]:
    """Move complete results into `out`, all of them even if a signal arrives; return their paths."""
    try:
        for path in written:
            path.replace(out / path.name)
    except Interrupted:
        for path in written:
            if path.exists():
                path.replace(out / path.name)
        raise
    return [out / path.name for path in written]


@contextmanager
def work_folder(out: Path) -> Iterator[Path]:
    """Yield the folder within `out` of a survey's intermediate files, from which the next run resumes.

    It is removed when the survey is done. After an error or a signal it is kept, unless this run made it
    and less than `WORTH_BYTES` are in it. A killed process always leaves it.
    """
    folder = out / WORK
    before = folder.exists()
    folder.mkdir(exist_ok=True)
    try:
        yield folder
    except UsageError:  # its manifest belongs to another survey: keep it
        if not before:
            shutil.rmtree(folder, ignore_errors=True)
        raise
    except BaseException:
        if not before and _size(folder) < WORTH_BYTES:
            shutil.rmtree(folder, ignore_errors=True)
        raise
    shutil.rmtree(folder, ignore_errors=True)


def _size(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
