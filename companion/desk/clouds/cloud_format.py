"""Format detection of cloud files, by their first bytes; text by its suffix."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

from companion.desk.clouds.cloud_source import is_transient, unread
from companion.runtime.errors import UsageError

Kind = Literal["las", "pcd", "ply", "text"]
HEAD = 512  # bytes
TEXT = frozenset({".xyz", ".txt", ".csv", ".asc"})
SUPPORTED = "LAS, LAZ, COPC, PCD, PLY, or text as .xyz, .txt or .csv"
_PCD_WORDS = (b"# .PCD", b"VERSION", b"FIELDS", b"COLUMNS")
_PLY_WORD = re.compile(rb"ply[ \t]*[\r\n]")
UTF_8_MARK = b"\xef\xbb\xbf"
_WIDE_MARKS = (b"\xff\xfe", b"\xfe\xff", b"\0\0\xfe\xff")  # of UTF-16 and UTF-32


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
