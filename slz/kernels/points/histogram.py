"""Histogram of heights, and its end gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.argument_types import Array1D, ReadOnly2D, Strided1D
from slz.kernels.jit import kernel, kernel_at_call, kernel_part

CHUNK = 64  # heights processed together
ONE = np.uint64(1)


@kernel_part
def _cut_off(count: Strided1D[np.int64], most: int, needed: int) -> int:
    """Return how many of the first bins are cut, see `ends_of`."""
    cut = empty = first = 0
    for b in range(len(count)):
        empty = empty + 1 if count[b] == 0 else 0
        cut += count[b]
        if cut > most:
            break
        if empty >= needed:
            first = b + 1
    return first


@kernel_at_call
def ends_of(count: Strided1D[np.int64], most: int, needed: int) -> tuple[int, int]:
    """Return the first and last bin after cutting at most `most` heights beyond `needed` empty bins."""
    first, last = _cut_off(count, most, needed), len(count) - 1 - _cut_off(count[::-1], most, needed)
    return (first, last) if first <= last else (0, len(count) - 1)


@kernel_part
def _count(height: Array1D[np.float64], low: float, width: float, bins: int) -> Array1D[np.int64]:
    """Count heights by bin, in two tables, so that successive increments of one bin need not wait."""
    count, at = np.zeros((2, bins), np.int64), np.empty(CHUNK, np.int32)
    for start in range(0, len(height), CHUNK):
        first, some = np.uint64(start), np.uint64(min(CHUNK, len(height) - start))
        for k in range(some):  # vectorised
            at[k] = np.int32((height[first + k] - low) / width)
        for k in range(some):
            count[k & ONE, np.uint64(at[k])] += 1
    whole: NDArray[np.int64] = count[0] + count[1]
    return whole


@kernel_part
def _range(height: Array1D[np.float64]) -> tuple[float, float]:
    """Return the least and the greatest height."""
    least, most = np.full(CHUNK, height[0]), np.full(CHUNK, height[0])
    whole = len(height) // CHUNK * CHUNK
    for start in range(0, whole, CHUNK):
        first = np.uint64(start)
        for k in range(np.uint64(CHUNK)):  # vectorised
            value = height[first + k]
            least[k] = value if value < least[k] else least[k]
            most[k] = value if value > most[k] else most[k]
    for i in range(whole, len(height)):
        least[0], most[0] = min(least[0], height[i]), max(most[0], height[i])
    return least.min(), most.max()


@kernel
def heights_within(points: ReadOnly2D[np.float64], which: Array1D[np.bool_]) -> Array1D[np.float64]:
    """Return the heights of the points (n, 3) selected by a mask (n,)."""
    out, n = np.empty(len(points)), 0
    for i in range(len(points)):
        out[n] = points[i, 2]
        n += which[i]
    return out[:n].copy()


@kernel
def beyond(
    points: ReadOnly2D[np.float64], which: Array1D[np.bool_], low: float, high: float
) -> Array1D[np.int64]:
    """Return the indices of such points that are lower or higher than an interval of heights."""
    out, n = np.empty(len(points), np.int64), 0
    for i in range(len(points)):
        out[n] = i
        n += which[i] and (points[i, 2] < low or points[i, 2] > high)
    return out[:n].copy()


@kernel
def gaps_of(height: Array1D[np.float64], gap: float, max_share: float) -> tuple[float, float]:
    """Return the interval of heights after cutting the few heights beyond an empty gap at either end."""
    low, high = _range(height)
    width = gap / 4
    bins = int((high - low) / width) + 1
    if bins > 100_000:
        bins = 100_000
        width = (high - low) / (bins - 1)
    count = _count(height, low, width, bins)
    first, last = ends_of(count, int(max_share * len(height)), 4 if width <= gap / 4 else 1)
    return low + first * width if first > 0 else low, low + (last + 1) * width if last < bins - 1 else high
