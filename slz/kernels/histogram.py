"""Histograms of heights."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel

CHUNK = 64  # heights taken at a time
ONE = np.uint64(1)
Counts = NDArray[np.int64]


@kernel("UniTuple(int64, 2)(int64[:], int64, int64)")
def ends_of(count: Counts, most: int, needed: int) -> tuple[int, int]:
    """Return the first and last bin left after cutting off at most so many beyond `needed` empty bins."""
    bins = len(count)
    first, last = 0, bins - 1
    cut, empty = 0, 0
    for b in range(bins):
        empty = empty + 1 if count[b] == 0 else 0
        cut += count[b]
        if cut > most:
            break
        if empty >= needed:
            first = b + 1
    cut, empty = 0, 0
    for b in range(bins - 1, -1, -1):
        empty = empty + 1 if count[b] == 0 else 0
        cut += count[b]
        if cut > most:
            break
        if empty >= needed:
            last = b - 1
    return (first, last) if first <= last else (0, bins - 1)


@kernel("int64[::1](float64[::1], float64, float64, int64)")
def _count(height: NDArray[np.float64], low: float, width: float, bins: int) -> Counts:
    """Count heights by bins, in two tables, since what is added to twice in a row has to be waited for."""
    count, at = np.zeros((2, bins), np.int64), np.empty(CHUNK, np.int32)
    for start in range(0, len(height), CHUNK):
        some = height[start : start + CHUNK]
        for k in range(np.uint64(len(some))):  # several at once
            at[k] = np.int32((some[k] - low) / width)
        for k in range(np.uint64(len(some))):
            count[k & ONE, np.uint64(at[k])] += 1
    whole: Counts = count[0] + count[1]
    return whole


@kernel("UniTuple(float64, 2)(float64[::1], float64, float64)")
def gaps_of(height: NDArray[np.float64], gap: float, max_share: float) -> tuple[float, float]:
    """Return the interval left after cutting off the few heights beyond an empty gap at either end."""
    low, high = height[0], height[0]
    for i in range(len(height)):
        low, high = min(low, height[i]), max(high, height[i])
    width = gap / 4
    bins = int((high - low) / width) + 1
    if bins > 100_000:
        bins = 100_000
        width = (high - low) / (bins - 1)
    count = _count(height, low, width, bins)
    first, last = ends_of(count, int(max_share * len(height)), 4 if width <= gap / 4 else 1)
    return low + first * width if first > 0 else low, low + (last + 1) * width if last < bins - 1 else high
