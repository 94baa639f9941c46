"""Sums over the cells of a zone and of what its contour encloses (SLZ paper §3.4.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.bits import Bits
from slz.kernels.jit import kernel

Bytes = NDArray[np.uint8]
Layer = NDArray[np.float32]

CELLS, ENCLOSED, SAFE, UNSAFE, CERTAINTY, SLOPE, ROUGHNESS = range(7)


@kernel("float64(float64, int64)")
def _mean(total: float, n: int) -> float:
    return total / n if n else np.nan


@kernel(
    "Tuple((float64[::1], uint64[:, ::1], uint64[:, ::1]))"
    "(uint8[:, :], uint8[:, :], uint8[:, :], uint8, uint8, float32[:, :], float32[:, :], float32[:, :],"
    " float32[:, :])"
)
def tally(
    own: Bytes,
    content: Bytes,
    state: Bytes,
    safe: np.uint8,
    unsafe: np.uint8,
    certainty: Layer,
    slope: Layer,
    roughness: Layer,
    height: Layer,
) -> tuple[NDArray[np.float64], Bits, Bits]:
    """Count the cells of a zone and average their maps.

    Parameters
    ----------
    own, content
        (rows, cols) 1 for the cells of the zone, and for those on and inside its contour.
    state, safe, unsafe
        State of the cells, and the two of its values that stand for safe and unsafe.

    Returns
    -------
    By `CELLS` and those after it: cells of the zone, cells enclosed, of them safe and unsafe, mean certainty
    of those enclosed, mean slope and roughness of the zone where they are finite, NaN of none. As bits the
    unsafe cells enclosed, and the zone's cells with a height.
    """
    rows, cols = content.shape
    holes, ground = (
        np.zeros((rows, (cols + 63) >> 6), np.uint64),
        np.zeros((rows, (cols + 63) >> 6), np.uint64),
    )
    n_own = n_all = n_safe = n_unsafe = n_slope = n_rough = 0
    sure = slopes = roughs = 0.0
    for r in range(rows):
        for c in range(cols):
            if content[r, c]:
                n_all += 1
                n_safe += state[r, c] == safe
                n_unsafe += state[r, c] == unsafe
                holes[r, c >> 6] |= np.uint64(state[r, c] == unsafe) << np.uint64(c & 63)
                sure += certainty[r, c]
            if own[r, c]:
                n_own += 1
                ground[r, c >> 6] |= np.uint64(np.isfinite(height[r, c])) << np.uint64(c & 63)
                if np.isfinite(slope[r, c]):
                    n_slope += 1
                    slopes += slope[r, c]
                if np.isfinite(roughness[r, c]):
                    n_rough += 1
                    roughs += roughness[r, c]
    out = np.array(
        [n_own, n_all, n_safe, n_unsafe, _mean(sure, n_all), _mean(slopes, n_slope), _mean(roughs, n_rough)]
    )
    return out, holes, ground
