"""Demand-zero arrays: large arrays of zeros that take memory only where they are written."""

from __future__ import annotations

import math
import mmap
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from slz.kernels.prefault import prefault

ZERO_BYTE = np.uint8(0)
LEAST_BYTES = 1 << 16  # bytes, below which an ordinary array is used


def demand_zeros(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Return zeros of a shape and dtype, in pages of the smallest size.

    `numpy.zeros` asks for huge pages where it can: each takes 2 MiB, and clearing it takes tens of
    milliseconds when memory is fragmented, however little of it is written.
    """
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size < LEAST_BYTES:
        return np.zeros(shape, dtype)
    return np.frombuffer(mmap.mmap(-1, size), dtype).reshape(shape)


def prefault_range(values: NDArray[Any], rows: slice, cols: slice) -> None:
    """Prefault a part of (rows, columns, ...), so that writing there does not wait; values are unchanged."""
    size = values.itemsize * math.prod(values.shape[2:])
    row = size * values.shape[1]
    count, length = rows.stop - rows.start, size * (cols.stop - cols.start)
    if count > 0 and length > 0:
        first = rows.start * row + cols.start * size
        prefault(values.reshape(-1).view(np.uint8), first, row, count, length, ZERO_BYTE)
