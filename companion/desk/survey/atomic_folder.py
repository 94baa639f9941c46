"""Folders of results that are not yet whole."""

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
WORTH_BYTES = 200_000_000  # of work done; less is done again sooner than it is explained


def look(out: Path) -> None:
    """Refuse a folder that is a file before minutes are spent; it is made when something is written."""
    there = next(part for part in (out, *out.parents) if part.exists())
    if not there.is_dir():
        raise UsageError(f"--out {out}: {there} is a file: name a folder")


@contextmanager
def claimed(out: Path) -> Iterator[None]:
    """Make a folder, and keep other runs out of it; if nothing comes to lie in it, it is removed again.

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
        os.close(folder)  # which unlocks it, as the end of the process does
        for part in made:
            with suppress(OSError):  # results lie in it
                part.rmdir()


def _lock(folder: int, out: Path) -> None:
    try:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise UsageError(f"--out {out}: another run writes to it: wait for it, or name another") from None
    except OSError as error:  # of a file system that has no locks
        log.debug("no lock on %s: %s", out, error)


@contextmanager
def unfinished(out: Path) -> Iterator[Path]:
    """Make a folder within `out` for results that are not yet whole; nothing of it is left behind."""
    with tempfile.TemporaryDirectory(prefix=".slz-map-", dir=out, ignore_cleanup_errors=True) as folder:
        yield Path(folder)


def finish(written: list[Path], out: Path) -> list[Path]:
    """Move whole results to where they belong, all of them, whatever signal comes; return where they are."""
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
    """Give the folder in `out` in which a survey keeps what it has done, to be taken up by the next run.

    It is removed when the survey is done. When an error or a signal ends the survey it is kept, unless it was
    not there before and little was done. A process that is killed leaves it in any case.
    """
    folder = out / WORK
    before = folder.exists()
    folder.mkdir(exist_ok=True)
    try:
        yield folder
    except UsageError:  # of a manifest that differs: not ours to remove
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
