"""Erosion of a bitmap by a square, updated incrementally: where a safe square fits."""

from __future__ import annotations

import numpy as np

from slz.kernels.jit import kernel, kernel_of_source_mode, kernel_part
from slz.kernels.raster.bitmap import NONE, Bits


@kernel_part
def erode_columns(bits: Bits, by: int) -> None:
    """Keep the cells whose neighbour `by` columns to the east is also set, in place."""
    far, near = by >> 6, np.uint64(by & 63)
    rest = np.uint64(64) - near
    rows, words = bits.shape
    for r in range(rows):
        for w in range(words):
            if bits[r, w] == NONE:
                continue
            low = bits[r, w + far] if w + far < words else NONE
            if near != NONE:
                high = bits[r, w + far + 1] if w + far + 1 < words else NONE
                low = (low >> near) | (high << rest)
            bits[r, w] &= low


@kernel_part
def erode_rows(bits: Bits, by: int) -> None:
    """Keep the cells whose neighbour `by` rows to the north is also set, in place."""
    rows, words = bits.shape
    for r in range(rows):
        if r + by < rows:
            for w in range(words):
                bits[r, w] &= bits[r + by, w]
        else:
            bits[r] = NONE


@kernel
def erode_to_side(bits: Bits, side: int, wanted: int) -> None:
    """Reduce south-west corners of set squares of one side to those of a larger side, in place."""
    while side < wanted:
        step = min(side, wanted - side)
        erode_columns(bits, step)
        erode_rows(bits, step)
        side += step


@kernel_of_source_mode
def erode(
    safe: Bits, seeds: Bits, side: int, row0: int, row1: int, col0: int, col1: int
) -> tuple[int, int, int, int]:
    """Update the seeds, the south-west corners of safe squares, where the safe map changed.

    Parameters
    ----------
    row0, row1, col0, col1
        Box in which cells changed.

    Returns
    -------
    row0, row1, word0, word1 (half open) of the box in which seeds may have changed.
    """
    first, last = max(0, row0 - side + 1), row1
    word0, word1 = max(0, col0 - side + 1) >> 6, ((col1 - 1) >> 6) + 1
    reach = min(safe.shape[0], last + side - 1)
    wide = min(safe.shape[1], word1 + ((side + 62) >> 6))
    part = safe[first:reach, word0:wide].copy()
    erode_to_side(part, 1, side)
    for r in range(last - first):
        for w in range(word1 - word0):
            seeds[first + r, word0 + w] = part[r, w]
    return first, last, word0, word1
