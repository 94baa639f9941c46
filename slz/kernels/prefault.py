"""Pages of memory asked for before they are needed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

PAGE = 4096  # bytes; where pages are larger some are touched more often than needed


@kernel("void(uint8[::1], int64, int64, int64, int64, uint8)")
def touch(
    memory: NDArray[np.uint8], first: int, apart: int, count: int, length: int, nothing: np.uint8
) -> None:
    """Write to every page of stretches of so many bytes, as many bytes apart, what it holds.

    `nothing` is 0: the compiler, which does not know that, would leave out what changes nothing.
    """
    for i in range(count):
        start = first + i * apart
        stop = start + length
        for at in range(start, stop, PAGE):
            memory[at] |= nothing
        memory[stop - 1] |= nothing
