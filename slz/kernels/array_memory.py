"""Memory of arrays: copies into larger arrays, demand-zero arrays, and prefaulting of pages.

Assigning to a slice costs Numba seconds of compile time, so elements are copied one by one."""

from __future__ import annotations

import math
import mmap
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from slz.kernels.argument_types import Array1D
from slz.kernels.jit import kernel, kernel_for_any_types

Table = NDArray[Any]
PAGE = 4096  # bytes; with larger pages some are touched more often than needed
ZERO_BYTE = np.uint8(0)
LEAST_BYTES = 1 << 16  # bytes, below which an ordinary array is used


@kernel_for_any_types
def put(out: NDArray[Any], at: int, values: NDArray[Any]) -> None:
    """Copy (n,) values into an array, from index `at` on."""
    for i in range(len(values)):
        out[at + i] = values[i]


@kernel_for_any_types
def put_rows(out: Table, at: int, rows: Table) -> None:
    """Copy (n, k) rows into a table, from row `at` on."""
    for i in range(len(rows)):
        for k in range(rows.shape[1]):
            out[at + i, k] = rows[i, k]


@kernel_for_any_types
def doubled(rows: Table) -> Table:
    """Return a (2 n, k) copy of a table; its second half is uninitialised."""
    out = np.empty((2 * len(rows), rows.shape[1]), rows.dtype)
    put_rows(out, 0, rows)
    return out


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
