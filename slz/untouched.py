"""Large arrays of zeros that take memory only where something is written."""

from __future__ import annotations

import math
import mmap
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

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
