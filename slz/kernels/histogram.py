"""Histograms of heights."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel


@kernel("UniTuple(int64, 2)(int64[:], int64, int64)")
def ends_of(count: NDArray[np.int64], most: int, needed: int) -> tuple[int, int]:
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


@kernel("UniTuple(float64, 2)(float64[:], float64, float64)")
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
    count = np.zeros(bins, np.int64)
    for i in range(len(height)):
        count[int((height[i] - low) / width)] += 1
    first, last = ends_of(count, int(max_share * len(height)), 4 if width <= gap / 4 else 1)
    return low + first * width if first > 0 else low, low + (last + 1) * width if last < bins - 1 else high
