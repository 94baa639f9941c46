"""State directory: files that persist from one start of the program to the next."""

from __future__ import annotations

import contextlib
import itertools
import logging
import os
import tempfile
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from companion.runtime.errors import UsageError

log = logging.getLogger(__name__)


def default_state_dir() -> Path:
    """Return `$XDG_STATE_HOME/slz`, or `~/.local/state/slz` without that variable."""
    home = os.environ.get("XDG_STATE_HOME", "")
    base = Path(home) if Path(home).is_absolute() else Path.home() / ".local" / "state"
    return base / "slz"


class StateDir:
    """Small text files with atomic replacement: a new version is written beside the file and then renamed.

    Safe to use in any thread.

    Raises
    ------
    UsageError
        The folder cannot be created or written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._numbers = itertools.count(1)
        self._disk: ThreadPoolExecutor | None = None
        self._last: Future[None] | None = None
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            why = error.strerror or error
            raise UsageError(f"--state-dir {folder} cannot be written: {why}") from None

    def read(self, name: str, *, damaged: bool = False) -> str | None:
        """Return a file's text, None if there is none.

        damaged: replace bytes that are not UTF-8 with U+FFFD, for readers that tolerate it.

        Raises
        ------
        UsageError
            The file exists and cannot be read.
        """
        path = self.folder / name
        if self._last is not None:
            self._last.result()
        try:
            return path.read_text("utf-8", "replace" if damaged else "strict")
        except FileNotFoundError:
            return None
        except (OSError, UnicodeDecodeError) as error:
            raise UsageError(f"{path} cannot be read: {error}") from None

    def write(self, name: str, text: str, *, durable: bool = True) -> str:
        """Replace a file; return the reason for a failure, or an empty string.

        durable: wait until the file would survive a power cut, which takes tens of milliseconds on some
        cards.
        """
        beside = self.folder / f".{name}.{next(self._numbers)}.new"
        try:
            with beside.open("w", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                if durable:
                    os.fsync(file.fileno())
            beside.replace(self.folder / name)
        except OSError as error:
            return _remove_and_describe(error, beside)
        return ""

    def sync(self, name: str) -> str:
        """Make a file durable that was written without `durable`; return the reason for a failure, or ""."""
        try:
            with (self.folder / name).open("rb") as file:
                os.fsync(file.fileno())
        except OSError as error:
            return str(error.strerror or error)
        return ""

    def write_behind(self, name: str, text: str) -> str:
        """Replace a file durably without waiting for the disk, which may take seconds on a busy card.

        Return the reason if the new version cannot be written, as on a full disk; a later failure is logged.
        Writes take effect in the order of the calls.
        """
        beside = self.folder / f".{name}.{next(self._numbers)}.new"
        try:
            beside.write_text(text, encoding="utf-8")
        except OSError as error:
            return _remove_and_describe(error, beside)
        self._disk = self._disk or ThreadPoolExecutor(1, "slz-state")
        self._last = self._disk.submit(self._finish, beside, self.folder / name)
        return ""

    @staticmethod
    def _finish(beside: Path, path: Path) -> None:
        try:
            with beside.open("rb+") as file:
                os.fsync(file.fileno())
            beside.replace(path)
        except OSError as error:
            log.error("%s not kept: %s", path, _remove_and_describe(error, beside))


def _remove_and_describe(error: OSError, beside: Path) -> str:
    """Remove a partly written file and return the reason for the failure."""
    with contextlib.suppress(OSError):
        beside.unlink()
    return str(error.strerror or error)
