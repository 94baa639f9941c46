"""Large arrays of zeros that take memory only where something is written."""

from __future__ import annotations

import math
import mmap
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from slz.kernels.prefault import touch

NOTHING = np.uint8(0)
LEAST = 1 << 16  # bytes, below which an ordinary array will do: larger ones it would fill at once


def untouched(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Return zeros of a shape and dtype, in pages of the system's smallest size.

    `numpy.zeros` asks for huge pages where it can: each then takes 2 MiB and its clearing tens of
    milliseconds when memory is in pieces, however little of it is written.
    """
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size < LEAST:
        return np.zeros(shape, dtype)
    return np.frombuffer(mmap.mmap(-1, size), dtype).reshape(shape)


def make_ready(values: NDArray[Any], rows: slice, cols: slice) -> None:
    """Have the system give the memory of a part of (rows, columns, ...), so that writing there does not wait.

    The values stay as they are.
    """
    size = values.itemsize * math.prod(values.shape[2:])
    row = size * values.shape[1]
    count, length = rows.stop - rows.start, size * (cols.stop - cols.start)
    if count > 0 and length > 0:
        first = rows.start * row + cols.start * size
        touch(values.reshape(-1).view(np.uint8), first, row, count, length, NOTHING)
