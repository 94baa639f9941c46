"""Plausibility check of a LAS or LAZ header against the file's size, before a library trusts its counts."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

from companion.desk.clouds.cloud_source import is_transient, unread
from companion.runtime.errors import UsageError

SHORTEST, SHORTEST_1_4 = 227, 375  # bytes of a LAS header (ASPRS LAS 1.4 R15, table 3)
FORMAT_AT, COMPRESSED = 104, 0xC0  # offset of the point format, and its two highest bits
RECORD_BYTES, EXTENDED_BYTES = 54, 60  # smallest variable length record and extended one
EXTENDED_LENGTH_AT = 20  # of the bytes behind an extended record's head


def check_header(path: Path) -> None:
    """Refuse a LAS or LAZ file whose header refers to more than the file holds.

    Raises
    ------
    UsageError
        Missing, unreadable, truncated or corrupt.
    """
    try:
        with path.open("rb") as file:
            head = file.read(SHORTEST_1_4)
            size = path.stat().st_size
            chunks = _chunks(file, head, size)
            records_end = _extended_end(file, head, size)
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file") from None
    except OSError as error:
        if is_transient(error):
            raise unread(path, error) from None
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    if len(head) < SHORTEST:
        raise UsageError(f"{path}: it is truncated within its header: copy it again")
    major, minor = head[24], head[25]
    if major != 1 or minor > 4:
        raise UsageError(f"{path}: it is LAS {major}.{minor}, and only 1.0 to 1.4 are supported")
    header_size, points_at, records = struct.unpack_from("<HII", head, 94)
    needed = header_size + records * RECORD_BYTES
    if points_at > size:
        raise UsageError(f"{path}: it is truncated, its points lie beyond its end: copy it again")
    if chunks > size:  # lazrs would allocate memory for them, and abort the process on failure
        raise UsageError(
            f"{path}: it is truncated or corrupt, its table names {chunks} chunks: copy it again"
        )
    if header_size < (SHORTEST_1_4 if minor == 4 else SHORTEST) or needed > points_at:
        raise UsageError(f"{path}: its header is corrupt: copy it again")
    if records_end > size:  # laspy would allocate memory for them
        raise UsageError(f"{path}: it is truncated or corrupt in its last records: copy it again")


def _extended_end(file: BinaryIO, head: bytes, size: int) -> int:
    """Return the end of the extended records by their own lengths, 0 without any."""
    if len(head) < SHORTEST_1_4 or head[25] != 4:
        return 0
    at, extended = struct.unpack_from("<QI", head, 235)
    if not extended:
        return 0
    for _ in range(extended):
        length = _number(file, at + EXTENDED_LENGTH_AT, "<Q")
        if length is None:
            return size + 1
        at += EXTENDED_BYTES + length
    return int(at)


def _chunks(file: BinaryIO, head: bytes, size: int) -> int:
    """Return the number of chunks of compressed points that a LAZ file states, 0 where it states none.

    The first 8 bytes of the points are the offset of the chunk table, or -1 if that is in the last 8 bytes
    of the file. The table begins with its version and the number of chunks (LASzip, laszip.org).
    """
    if len(head) < SHORTEST or not head[FORMAT_AT] & COMPRESSED:
        return 0
    (points_at,) = struct.unpack_from("<I", head, 96)
    place = _number(file, points_at, "<q")
    if place == -1:
        place = _number(file, size - 8, "<q")
    return 0 if place is None or place < 0 else _number(file, place + 4, "<I") or 0


def _number(file: BinaryIO, at: int, form: str) -> int | None:
    """Return a number at an offset of a file, None beyond its end."""
    file.seek(max(0, min(at, 2**62)))
    data = file.read(struct.calcsize(form))
    return int(struct.unpack(form, data)[0]) if len(data) == struct.calcsize(form) else None
