"""Which heights of a window are accepted: the sources' histogram (SLZ paper §3.2.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.bits import signed
from slz.kernels.jit import kernel
from slz.kernels.stream import DROPPED

Points = NDArray[np.float64]
Counts = NDArray[np.int32]
CHUNK = 64  # points, of which seldom one lies near a bin's edge or far from the others
SAMPLED = 8  # one chunk of so many is counted to see where the points are
MANY = 50_000  # points, from which on that is worth while
FOUR = np.uint64(3)


@kernel("boolean(uint32[::1], float32[::1], float64, float64, int64, uint16[::1])")
def _bins(
    cells: NDArray[np.uint32],
    heights: NDArray[np.float32],
    shift: float,
    scale: float,
    bins: int,
    out: NDArray[np.uint16],
) -> bool:
    """Leave the bins of a chunk's heights, one more for those dropped; tell whether one may be wrong.

    That is so of a height so near a bin's edge that rounding to four bytes may have moved it over. Without a
    branch, so that the compiler takes four at a time.
    """
    near, last, odd = 0.5 - bins * 2.0**-22, np.int32(bins - 1), 0
    for i in range(np.uint64(len(cells))):
        at = (float(heights[i]) + shift) * scale
        b = np.int32(at)
        odd |= signed(abs(at - b - 0.5) > near)
        b = last if b > last else b
        out[i] = np.uint16(bins) if cells[i] == DROPPED else np.uint16(b)
    return odd != 0


@kernel("boolean(float32[::1], float32, float32)")
def _any_beyond(heights: NDArray[np.float32], least: np.float32, most: np.float32) -> bool:
    """Tell whether a height is below the least or above the most."""
    beyond = 0
    for i in range(np.uint64(len(heights))):
        beyond |= signed((heights[i] < least) | (heights[i] > most))
    return beyond != 0


@kernel(
    "void(Array(float64, 1, 'C', True), uint32[::1], float32[::1], float64, float64, float64, int64, float32,"
    " float32, int32[:, ::1])"
)
def _count(
    points: Points,
    cells: NDArray[np.uint32],
    heights: NDArray[np.float32],
    level: float,
    low: float,
    scale: float,
    every: int,
    least: np.float32,
    most: np.float32,
    count: Counts,
) -> None:
    """Count by bins the points of every so many chunks, but of those that lie whole from least to most."""
    count[:] = 0
    bins, mine = count.shape[1] - 1, np.empty(CHUNK, np.uint16)
    for start in range(0, len(cells), CHUNK * every):
        some = slice(start, min(len(cells), start + CHUNK))
        if not _any_beyond(heights[some], least, most):
            continue
        if _bins(cells[some], heights[some], level - low, scale, bins, mine):
            for i in range(some.start, some.stop):
                if cells[i] != DROPPED:
                    mine[i - start] = min(bins - 1, int((points[3 * i + 2] - low) * scale))
        for i in range(np.uint64(some.stop - some.start)):
            count[i & FOUR, mine[i]] += 1


@kernel("UniTuple(int64, 2)(int32[:, ::1], float64)")
def _not_sparse(count: Counts, sparse: float) -> tuple[int, int]:
    """Return the first and the last bin that are not sparse; the number of bins for the first if all are."""
    bins = count.shape[1] - 1
    first, last = 0, bins - 1
    while first < bins and count[:, first].sum() < sparse:
        first += 1
    while last > first and count[:, last].sum() < sparse:
        last -= 1
    return first, last


@kernel("UniTuple(int64, 2)(int32[:, ::1], float64, int64, float64)")
def _trimmed(count: Counts, sparse: float, n: int, threshold: float) -> tuple[int, int]:
    """Return the first and last bin that stay."""
    first, last, left = 0, count.shape[1] - 2, n
    while first < last:
        lower, upper = count[:, first].sum(), count[:, last].sum()
        fewer = min(lower, upper)
        if fewer >= sparse or left - fewer < threshold * n:
            break
        left -= fewer
        if lower <= upper:
            first += 1
        else:
            last -= 1
    return first, last


@kernel(
    "UniTuple(float64, 2)(Array(float64, 1, 'C', True), uint32[::1], float32[::1], float64, float64, float64,"
    " int64, int64, float64)"
)
def interval(
    points: Points,
    cells: NDArray[np.uint32],
    heights: NDArray[np.float32],
    level: float,
    low: float,
    high: float,
    n: int,
    bins: int,
    threshold: float,
) -> tuple[float, float]:
    """Return the accepted heights of n points not dropped (SLZ paper §3.2.1, SLZ thesis §3.3.1.1).

    The sources give two numbers, 300 bins and a threshold of 0.9, without saying how the accepted interval is
    formed. Here an end bin is sparse when it holds less than (1 - threshold) of the mean bin population.
    Sparse end bins are trimmed, the emptier end first, while at least `threshold` of all points stay.

    A bin that is not sparse by a sample of the points is not by all. Nothing is trimmed between two such
    bins, so that only points beyond them are counted. A height that lies so near a bin's edge that rounding
    to four bytes may move it over is looked up.
    """
    if not high > low:
        return low, high
    count = np.empty((4, bins + 1), np.int32)  # four, so that equal bins one after the other need not wait
    scale, sparse = bins / (high - low), (1 - threshold) * n / bins
    least, most = np.float32(np.inf), np.float32(-np.inf)
    first, last, near = bins, 0, bins * 2.0**-22
    if n > MANY:
        _count(points, cells, heights, level, low, scale, SAMPLED, least, most, count)
        first, last = _not_sparse(count, sparse)
        if first < bins:
            least = np.float32(low - level + (first + near) / scale)
            most = np.float32(low - level + (last + 1 - near) / scale)
    _count(points, cells, heights, level, low, scale, 1, least, most, count)
    if first < bins:
        count[0, first] = count[0, last] = n
    first, last = _trimmed(count, sparse, n, threshold)
    return low + first / scale, low + (last + 1) / scale
