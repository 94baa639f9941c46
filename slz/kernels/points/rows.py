"""Rows of returns chosen by their flags."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D
from slz.kernels.jit import kernel


@kernel
def rows_of(flags: Array1D[np.uint16], has: int, lacks: int) -> Array1D[np.int64]:
    """Return the rows whose flags hold all of `has` and none of `lacks`."""
    out, n, asked = np.empty(len(flags), np.int64), 0, has | lacks
    for i in range(len(flags)):
        out[n] = i
        n += (flags[i] & asked) == has
    return out[:n].copy()


@kernel
def mark(flags: Array1D[np.uint16], rows: Array1D[np.int64], which: Array1D[np.bool_], flag: int) -> None:
    """Set a flag of the rows that a mask selects."""
    for k in range(len(rows)):
        flags[rows[k]] |= np.uint16(flag) if which[k] else np.uint16(0)


@kernel
def rows_in_turn(flags: Array1D[np.uint16], first: int, others: Array1D[np.uint16]) -> Array1D[np.int64]:
    """Return the rows whose flags hold `first`, then those of each other flag that do not hold it."""
    out, n, kept = np.empty((1 + len(others)) * len(flags), np.int64), 0, np.uint16(first)
    for i in range(len(flags)):
        out[n] = i
        n += (flags[i] & kept) != 0
    for other in others:
        for i in range(len(flags)):
            if (flags[i] & (other | kept)) == other:
                out[n] = i
                n += 1
    return out[:n].copy()


@kernel
def picked(
    places: Array2D[np.float64], flags: Array1D[np.uint16], has: int, lacks: int
) -> Array2D[np.float64]:
    """Return the places of such rows."""
    out, n, asked = np.empty((len(flags), 3)), 0, has | lacks
    for i in range(len(flags)):
        out[n, 0], out[n, 1], out[n, 2] = places[i, 0], places[i, 1], places[i, 2]
        n += (flags[i] & asked) == has
    return out[:n].copy()


@kernel
def rows_by_scan(
    flags: Array1D[np.uint16], has: int, last: int, origin: ReadOnly1D[np.uint16], scans: int
) -> Array1D[np.int64]:
    """Return the rows whose flags hold some of `has` or `last`, by scan; those with `last` end each scan."""
    starts, asked = np.zeros(2 * scans + 1, np.int64), has | last
    for i in range(len(flags)):
        if flags[i] & asked:
            starts[2 * origin[i] + ((flags[i] & last) != 0) + 1] += 1
    for k in range(2 * scans):
        starts[k + 1] += starts[k]
    out = np.empty(starts[-1], np.int64)
    for i in range(len(flags)):
        if flags[i] & asked:
            k = 2 * origin[i] + ((flags[i] & last) != 0)
            out[starts[k]] = i
            starts[k] += 1
    return out
