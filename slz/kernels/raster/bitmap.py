"""Bitmap, 64 cells a word: bit c & 63 of word (r, c >> 6) is cell (r, c)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from slz.kernels.argument_types import Array2D, Strided2D
from slz.kernels.jit import kernel_part

Bits = Array2D[np.uint64]
NONE, ONE, LAST = np.uint64(0), np.uint64(1), np.uint64(63)
signed = cast(Callable[[Any], int], np.int64)  # converts a word to a number that mixes with other integers
ALL = np.uint64(0xFFFFFFFFFFFFFFFF)


def _operation(build: Callable[[Any, Any], Any], plain: Callable[[int], int]) -> Any:
    """Return a kernel function of one word, one machine instruction; uncompiled, `plain` computes it."""
    if vars(config)["DISABLE_JIT"]:
        return lambda word: np.uint64(plain(int(word)))

    def typed(_: Any, word: Any) -> Any:  # pragma: no cover - the compiler's, not run where a cache answers
        def code(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
            return build(builder, args[0])

        return types.uint64(types.uint64), code

    return intrinsic(typed)


def _lowest(word: int) -> int:
    return (word & -word).bit_length() - 1 if word else 64


def _leading(word: int) -> int:
    return 64 - word.bit_length()


popcount = _operation(lambda builder, word: builder.ctpop(word), int.bit_count)
lowest = _operation(lambda builder, word: builder.cttz(word, ir.Constant(ir.IntType(1), 0)), _lowest)
leading = _operation(lambda builder, word: builder.ctlz(word, ir.Constant(ir.IntType(1), 0)), _leading)


@kernel_part
def bit(bits: Strided2D[np.uint64], row: int, col: int) -> np.uint64:
    """Return 1 where a cell is set, else 0."""
    word: np.uint64 = bits[row, col >> 6]
    return (word >> np.uint64(col & 63)) & ONE


@kernel_part
def word_at(bits: Strided2D[np.uint64], row: int, col: int) -> np.uint64:
    """Return the 64 cells from a column on, which may be outside; cells outside are 0."""
    if row < 0 or row >= bits.shape[0]:
        return NONE
    k, shift = col >> 6, np.uint64(col & 63)
    low = bits[row, k] if 0 <= k < bits.shape[1] else NONE
    if shift == NONE:
        return low
    high = bits[row, k + 1] if -1 <= k < bits.shape[1] - 1 else NONE
    return (low >> shift) | (high << (np.uint64(64) - shift))


@kernel_part
def word_mask(first: int, stop: int) -> np.uint64:
    """Return a mask of bits first to stop - 1; the range may extend beyond the word but must overlap it."""
    return (ALL << np.uint64(max(0, first))) & (ALL >> np.uint64(64 - min(64, stop)))


@kernel_part
def prefix_xor(word: np.uint64) -> np.uint64:
    """Return the prefix parity of a word: bit i is the exclusive or of its bits 0 to i."""
    for shift in (1, 2, 4, 8, 16, 32):
        word ^= word << np.uint64(shift)
    return word


def unpacked(bits: Bits, first: int, cols: int) -> NDArray[np.uint8]:
    """Return cells as bytes, `cols` columns from column `first` on; a view into whole words."""
    cells = np.unpackbits(bits.view(np.uint8), axis=1, bitorder="little")
    return np.asarray(cells[:, first : first + cols])


def packed(cells: NDArray[np.uint8]) -> Bits:
    """Return the bitmap of cells given as bytes."""
    rows, cols = cells.shape
    out = np.zeros((rows, 8 * ((cols + 63) >> 6)), np.uint8)
    out[:, : (cols + 7) >> 3] = np.packbits(cells, axis=1, bitorder="little")
    return out.view(np.uint64)
