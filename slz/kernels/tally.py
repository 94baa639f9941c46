"""Sums over the cells of a zone and of what its contour encloses (SLZ paper §3.4.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.bits import NONE, ONE, Bits, popcount, signed
from slz.kernels.jit import kernel

Bytes = NDArray[np.uint8]
Layer = NDArray[np.float32]
Sums = NDArray[np.float64]

CELLS, ENCLOSED, SAFE, UNSAFE = range(4)  # counts
CERTAINTY, SLOPE, SLOPES, ROUGHNESS, ROUGHNESSES = range(5)  # sums, and how many were added to the one before


@kernel()
def _add(sums: Sums, of: int, values: NDArray[np.float32], first: np.uint64, cells: np.uint64) -> None:
    """Add those of 64 values that are set and finite, each to a sum of its own, and count them."""
    for k in range(np.uint64(64)):
        value = np.float64(values[first + k])
        counts = ((cells >> k) & ONE != NONE) & (np.abs(value) < np.inf)
        sums[of, k] += value if counts else 0.0
        sums[of + 1, k] += 1.0 if counts else 0.0


@kernel(
    "void(uint64[:, :], uint64[:, :], uint8[:, ::1], uint8, uint8, float32[:, ::1], float32[:, ::1],"
    " float32[:, ::1], int64[::1], float64[:, ::1], uint64[:, :])"
)
def tally(
    own: Bits,
    content: Bits,
    state: Bytes,
    safe: np.uint8,
    unsafe: np.uint8,
    certainty: Layer,
    slope: Layer,
    roughness: Layer,
    counts: NDArray[np.int64],
    sums: Sums,
    holes: Bits,
) -> None:
    """Count the cells of some rows of a zone and add up their maps, which are of the cells of the words.

    Parameters
    ----------
    own, content
        The cells of the zone, and those on and inside its contour.
    state, safe, unsafe
        State of the cells, and the two of its values that stand for safe and unsafe.
    counts
        Receives by `CELLS` and those after it: cells of the zone, cells enclosed, of them safe and unsafe.
    sums
        (5, 64) receives by `CERTAINTY` and those after it, and by place in the word: the certainty of the
        cells enclosed; slope and roughness of the zone where they are finite, and how many those are.
    holes
        Receives the unsafe cells enclosed.
    """
    rows, words = content.shape
    state_of, certainty_of = state.ravel(), certainty.ravel()
    slope_of, roughness_of = slope.ravel(), roughness.ravel()
    for r in range(rows):
        for w in range(words):
            inside, mine, at = content[r, w], own[r, w], np.uint64(64 * (r * words + w))
            if inside == NONE:
                continue
            good = bad = NONE
            for k in range(np.uint64(64)):
                good |= np.uint64(state_of[at + k] == safe) << k
                bad |= np.uint64(state_of[at + k] == unsafe) << k
            for k in range(np.uint64(64)):
                sure = np.float64(certainty_of[at + k])
                sums[CERTAINTY, k] += sure if (inside >> k) & ONE != NONE else 0.0
            if mine != NONE:
                _add(sums, SLOPE, slope_of, at, mine)
                _add(sums, ROUGHNESS, roughness_of, at, mine)
            holes[r, w] = inside & bad
            counts[CELLS] += signed(popcount(mine))
            counts[ENCLOSED] += signed(popcount(inside))
            counts[SAFE] += signed(popcount(inside & good))
            counts[UNSAFE] += signed(popcount(inside & bad))
