"""Rows of returns chosen by their flags."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
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
def picked(
    places: Array2D[np.float64], flags: Array1D[np.uint16], has: int, lacks: int
) -> Array2D[np.float64]:
    """Return the places of such rows."""
    out, n, asked = np.empty((len(flags), 3)), 0, has | lacks
    for i in range(len(flags)):
        out[n, 0], out[n, 1], out[n, 2] = places[i, 0], places[i, 1], places[i, 2]
        n += (flags[i] & asked) == has
    return out[:n].copy()
