"""Plausibility check of the chunks of a LAZ file, before its library allocates memory for them.

A chunk of point formats 6 to 10 begins with a whole point, then the number of points, then the bytes of
each layer, which holds one or a few fields (LASzip 3, laszip.org). The library trusts these numbers.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

import lazrs

from companion.runtime.errors import UsageError

MOST_BYTES = 1 << 28  # of a chunk's points, which its reader allocates; 50,000 points are usual
LAYERED = 3  # the compressor of formats 6 to 10
_HEAD = struct.Struct("<H")
_ITEM = struct.Struct("<HHH")  # type, bytes, version
_ITEMS_AT = 32
POINT14, RGB14, RGBNIR14, WAVEPACKET14, BYTE14 = 10, 11, 12, 13, 14
_LAYERS = {POINT14: 9, RGB14: 1, RGBNIR14: 2, WAVEPACKET14: 1}


def check_chunks(path: Path, points_at: int, point_bytes: int, record: bytes, n_points: int) -> None:
    """Refuse chunks that claim more than their bytes, and a header whose point count differs from theirs.

    Parameters
    ----------
    points_at, point_bytes
        From the header: offset of the points, and size of one.
    record
        The LASzip record.
    n_points
        From the header.

    Raises
    ------
    UsageError
        A chunk is corrupt, too large or beyond the file's end, or there are too few or too many of them.
    """
    size = path.stat().st_size
    packing = lazrs.LazVlr(record)
    if not packing.chunk_size():  # lazrs would divide by it
        raise UsageError(f"{path}: it is corrupt, its chunks are of no points: copy it again")
    layers = _layers(record)
    with path.open("rb") as file:
        file.seek(points_at)
        table = [chunk for chunk in lazrs.read_chunk_table(file, packing) if chunk[1]]
        held = sum(count for count, _ in table)  # for the last chunk this is its capacity
        if n_points > held:
            raise UsageError(
                f"{path}: it is truncated or corrupt, its header tells of {n_points} points, its chunks hold"
                f" {held} at most: copy it again"
            )
        at, stated, last = points_at + 8, 0, 0
        for number, (most, chunk_bytes) in enumerate(table):
            if most * point_bytes > MOST_BYTES:  # lazrs would abort the process if memory is short
                raise UsageError(
                    f"{path}: its chunk {number + 1} may hold {most} points, too many to be read at once:"
                    " write it again in chunks of 50,000 points, or copy it again if it is corrupt"
                )
            stated, claimed = _head(file, at + point_bytes, layers) if layers else (most, 0)
            last = most
            if at + chunk_bytes > size or claimed > chunk_bytes:
                raise UsageError(f"{path}: it is truncated or corrupt in chunk {number + 1}: copy it again")
            at += chunk_bytes
    # In older formats the count of the last chunk is known only after decompression: at least one.
    exact = layers or packing.uses_variable_size_chunks()
    check_none_follow(path, n_points, held - last + (min(stated, last) if exact else 1) - n_points)


def check_none_follow(path: Path, n_points: int, more: int) -> None:
    """Refuse a file with more points than its header states, since they may include an obstacle.

    Raises
    ------
    UsageError
        It has `more` points, at least.
    """
    if more > 0:
        raise UsageError(
            f"{path}: its header tells of {n_points} points, at least {more} follow after them: repair its"
            " header (as lasinfo -repair does) or copy it again"
        )


def _layers(record: bytes) -> int:
    """Return the number of layers of a chunk, 0 where it has none."""
    if _HEAD.unpack_from(record)[0] != LAYERED:
        return 0
    (count,) = _HEAD.unpack_from(record, _ITEMS_AT)
    items = (_ITEM.unpack_from(record, _ITEMS_AT + 2 + k * _ITEM.size) for k in range(count))
    return sum(size if kind == BYTE14 else _LAYERS.get(kind, 0) for kind, size, _ in items)


def _head(file: BinaryIO, at: int, layers: int) -> tuple[int, int]:
    """Return the number of points that a chunk states, and the bytes that its layers claim."""
    file.seek(at)
    data = file.read(4 * (1 + layers))
    stated, *claimed = struct.unpack(f"<{len(data) // 4}I", data[: len(data) // 4 * 4]) or (0,)
    return stated, sum(claimed)
