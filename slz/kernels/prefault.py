"""Prefaulting of memory pages, before they are needed."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D
from slz.kernels.jit import kernel

PAGE = 4096  # bytes; with larger pages some are touched more often than needed


@kernel
def prefault(
    memory: Array1D[np.uint8], first: int, apart: int, count: int, length: int, nothing: np.uint8
) -> None:
    """Prefault the pages of `count` byte ranges, `apart` bytes apart, by rewriting their contents.

    `nothing` must be 0. It is an argument, because the compiler would drop an OR with a constant 0.
    """
    for i in range(count):
        start = first + i * apart
        stop = start + length
        for at in range(start, stop, PAGE):
            memory[at] |= nothing
        memory[stop - 1] |= nothing
