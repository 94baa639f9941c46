"""A look at the chunks of a LAZ file, before its library asks for memory for what they claim to hold.

In a chunk of point formats 6 to 10 a whole point comes first, then the number of points, then the bytes of
each layer, which is a field or a few of them (LASzip 3, laszip.org). The library trusts these numbers.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

import lazrs

from companion.errors import UsageError

LAYERED = 3  # the compressor of formats 6 to 10
_HEAD = struct.Struct("<H")
_ITEM = struct.Struct("<HHH")  # type, bytes, version
_ITEMS_AT = 32
POINT14, RGB14, RGBNIR14, WAVEPACKET14, BYTE14 = 10, 11, 12, 13, 14
_LAYERS = {POINT14: 9, RGB14: 1, RGBNIR14: 2, WAVEPACKET14: 1}


def check_chunks(path: Path, points_at: int, point_bytes: int, record: bytes, n_points: int) -> None:
    """Refuse chunks that claim more than their own bytes, and a header with more points than they hold.

    Parameters
    ----------
    points_at, point_bytes
        Of the header: where the points begin, and how long one is.
    record
        The LASzip record.
    n_points
        Of the header.

    Raises
    ------
    UsageError
        A chunk is corrupt or lies beyond the file's end, or there are too few of them.
    """
    size = path.stat().st_size
    layers = _layers(record)
    with path.open("rb") as file:
        file.seek(points_at)
        table = lazrs.read_chunk_table(file, lazrs.LazVlr(record))
        held = sum(count for count, _ in table)  # of the last chunk this is what it may hold
        if n_points > held:
            raise UsageError(
                f"{path}: it is truncated or corrupt, its header tells of {n_points} points, its chunks hold"
                f" {held} at most: copy it again"
            )
        at = points_at + 8
        for number, (_, chunk_bytes) in enumerate(table):
            claimed = _claimed(file, at + point_bytes, layers) if layers else 0
            if at + chunk_bytes > size or claimed > chunk_bytes:
                raise UsageError(f"{path}: it is truncated or corrupt in chunk {number + 1}: copy it again")
            at += chunk_bytes


def _layers(record: bytes) -> int:
    """Return how many layers a chunk has, 0 where it has none."""
    if _HEAD.unpack_from(record)[0] != LAYERED:
        return 0
    (count,) = _HEAD.unpack_from(record, _ITEMS_AT)
    items = (_ITEM.unpack_from(record, _ITEMS_AT + 2 + k * _ITEM.size) for k in range(count))
    return sum(size if kind == BYTE14 else _LAYERS.get(kind, 0) for kind, size, _ in items)


def _claimed(file: BinaryIO, at: int, layers: int) -> int:
    """Return the bytes that a chunk's layers claim."""
    file.seek(at + 4)
    data = file.read(4 * layers)
    return sum(struct.unpack(f"<{len(data) // 4}I", data[: len(data) // 4 * 4]))
