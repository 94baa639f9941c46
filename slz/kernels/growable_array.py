"""Growable arrays: copies into larger arrays, element by element.

Assigning to a slice costs Numba seconds of compile time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel_for_any_types

Table = NDArray[Any]


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
