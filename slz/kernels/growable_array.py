"""Rows put into larger arrays, one number at a time: a slice for a target costs Numba seconds to compile."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

Table = NDArray[Any]


@kernel()
def put(out: NDArray[Any], at: int, values: NDArray[Any]) -> None:
    """Set (n,) values from a place on."""
    for i in range(len(values)):
        out[at + i] = values[i]


@kernel()
def put_rows(out: Table, at: int, rows: Table) -> None:
    """Set (n, k) rows from a place on."""
    for i in range(len(rows)):
        for k in range(rows.shape[1]):
            out[at + i, k] = rows[i, k]


@kernel()
def doubled(rows: Table) -> Table:
    """Return (2 n, k) a table with room for as many rows again."""
    out = np.empty((2 * len(rows), rows.shape[1]), rows.dtype)
    put_rows(out, 0, rows)
    return out
