"""The state directory: what the program remembers from one start to the next."""

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
    """Return `$XDG_STATE_HOME/slz`, without that variable `~/.local/state/slz`."""
    home = os.environ.get("XDG_STATE_HOME", "")
    base = Path(home) if Path(home).is_absolute() else Path.home() / ".local" / "state"
    return base / "slz"


class StateDir:
    """Small text files that are always whole: each is written beside its place and then put there.

    May be used in any thread.

    Raises
    ------
    UsageError
        The folder cannot be made or written.
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

        damaged: bytes that are no text become U+FFFD, for readers who can do without.

        Raises
        ------
        UsageError
            It is there and cannot be read.
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
        """Replace a file; return why that failed, empty if it did not.

        durable: wait until it would survive a power cut, which takes tens of milliseconds on some cards.
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
            return _told(error, beside)
        return ""

    def sync(self, name: str) -> str:
        """Wait until what was written without `durable` is; return why that failed, empty if it did not."""
        try:
            with (self.folder / name).open("rb") as file:
                os.fsync(file.fileno())
        except OSError as error:
            return str(error.strerror or error)
        return ""

    def write_behind(self, name: str, text: str) -> str:
        """Replace a file durably without waiting for the disk, which may take seconds on a busy card.

        Return why it cannot be written, as on a full disk; what fails later is logged. Order is kept.
        """
        beside = self.folder / f".{name}.{next(self._numbers)}.new"
        try:
            beside.write_text(text, encoding="utf-8")
        except OSError as error:
            return _told(error, beside)
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
            log.error("%s not kept: %s", path, _told(error, beside))


def _told(error: OSError, beside: Path) -> str:
    """Return why a file could not be written, and leave nothing of it."""
    with contextlib.suppress(OSError):
        beside.unlink()
    return str(error.strerror or error)
