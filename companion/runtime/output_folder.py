"""Output folders named by the user."""

from __future__ import annotations

import tempfile
from pathlib import Path

from companion.runtime.errors import UsageError


def prepare(out: Path) -> None:
    """Create the folder of `--out` and check that a file can be written there.

    Raises
    ------
    UsageError
        The path is a file, or the folder cannot be created or written.
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
