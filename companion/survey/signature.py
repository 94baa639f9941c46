"""A first look at a file, before a library trusts the counts in its header."""

from __future__ import annotations

import struct
from pathlib import Path

from companion.errors import UsageError

SHORTEST, SHORTEST_1_4 = 227, 375  # bytes of a LAS header (ASPRS LAS 1.4 R15, table 3)
RECORD_BYTES, EXTENDED_BYTES = 54, 60  # least bytes of a variable length record and an extended one


def look(path: Path) -> None:
    """Refuse what is no LAS or LAZ file, and one whose header asks for more than the file holds.

    Raises
    ------
    UsageError
        Missing, unreadable, empty, of another kind, truncated or corrupt.
    """
    try:
        with path.open("rb") as file:
            head = file.read(SHORTEST_1_4)
            size = path.stat().st_size
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file") from None
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    if not head:
        raise UsageError(f"{path}: it is empty")
    if head[:4] != b"LASF":
        raise UsageError(f"{path}: it is not a LAS or LAZ file, and only these are supported")
    if len(head) < SHORTEST:
        raise UsageError(f"{path}: it is truncated within its header: copy it again")
    major, minor = head[24], head[25]
    if major != 1 or minor > 4:
        raise UsageError(f"{path}: it is LAS {major}.{minor}, and only 1.0 to 1.4 are supported")
    header_size, points_at, records = struct.unpack_from("<HII", head, 94)
    needed = header_size + records * RECORD_BYTES
    if points_at > size:
        raise UsageError(f"{path}: it is truncated, its points lie beyond its end: copy it again")
    if header_size < (SHORTEST_1_4 if minor == 4 else SHORTEST) or needed > points_at:
        raise UsageError(f"{path}: its header is corrupt: copy it again")
    if minor == 4 and len(head) == SHORTEST_1_4:
        start, extended = struct.unpack_from("<QI", head, 235)
        if extended and start + extended * EXTENDED_BYTES > size:
            raise UsageError(f"{path}: it is truncated, its last records are missing: copy it again")
