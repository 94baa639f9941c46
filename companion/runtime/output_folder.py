"""Folders that the user names for results."""

from __future__ import annotations

import tempfile
from pathlib import Path

from companion.runtime.errors import UsageError


def prepare(out: Path) -> None:
    """Make the folder of `--out` and see that a file can be written there.

    Raises
    ------
    UsageError
        It is a file, or it cannot be made or written.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        if isinstance(error, FileExistsError | NotADirectoryError):
            raise UsageError(f"--out {out}: a file is in the way: name a folder") from None
        raise UsageError(f"--out {out} cannot be made: {error.strerror}") from None
    try:
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise UsageError(f"--out {out} cannot be written: {error.strerror}") from None
