"""Height gate of source mode: histogram outlier removal (SLZ paper, section 3.2.1)."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.paper.point_pass import DROPPED
from slz.kernels.raster.bitmap import NONE, ONE, lowest, signed
from slz.kernels.simd import LANES, broadcast, flags_of, load

Points = ReadOnly1D[np.float64]
Counts = Array2D[np.int32]
CHUNK = 64  # points, few enough that a chunk seldom has one near a bin's edge or far from the others
SAMPLE_EVERY = 64  # one chunk in 64 is counted to estimate the distribution
CLEARLY = 4.0  # multiple of a sparse bin's population, above which the sample shows a bin not to be sparse
SAMPLED_ABOVE = 50_000  # points, above which sampling is worthwhile
HEIGHT_ROUNDING = 2.0**-22  # error of a height in float32, in bins, per bin
FOUR = np.uint64(3)


@kernel_part
def _bins(
    cells: Array1D[np.uint32],
    heights: Array1D[np.float32],
    shift: float,
    scale: float,
    bins: int,
    out: Array1D[np.uint16],
) -> bool:
    """Write the bins of a chunk's heights, `bins` for dropped points; return whether one may be wrong.

    A height so near a bin's edge that rounding to float32 may have moved it across may be wrong. The loop has
    no branch, so that the compiler vectorises it.
    """
    near, last, odd = 0.5 - bins * HEIGHT_ROUNDING, np.int32(bins - 1), 0
    for i in range(np.uint64(len(cells))):
        at = (float(heights[i]) + shift) * scale
        b = np.int32(at)
        odd |= signed(abs(at - b - 0.5) > near)
        b = last if b > last else b
        out[i] = np.uint16(bins) if cells[i] == DROPPED else np.uint16(b)
    return odd != 0


@kernel_part
def _count_by_bin(
    points: Points,
    cells: Array1D[np.uint32],
    heights: Array1D[np.float32],
    level: float,
    low: float,
    scale: float,
    every: int,
    count: Counts,
) -> None:
    """Count the points of one chunk in `broadcast` by bin."""
    count[:] = 0
    bins, mine = count.shape[1] - 1, np.empty(CHUNK, np.uint16)
    for start in range(0, len(cells), CHUNK * every):
        some = slice(start, min(len(cells), start + CHUNK))
        if _bins(cells[some], heights[some], level - low, scale, bins, mine):
            for i in range(some.start, some.stop):
                if cells[i] != DROPPED:
                    mine[i - start] = min(bins - 1, int((points[3 * i + 2] - low) * scale))
        for i in range(np.uint64(some.stop - some.start)):
            count[i & FOUR, mine[i]] += 1


@kernel_part
def _outside_mask(heights: Array1D[np.float32], start: int, least: np.float32, most: np.float32) -> np.uint64:
    """Return a mask of 64 heights, fewer at the end: 1 below the least or above the most."""
    word, i = NONE, np.uint64(0)
    if start + CHUNK <= len(heights):
        for at in range(start, start + CHUNK, LANES):
            some = load(heights, at)
            word |= (flags_of(some < broadcast(least)) | flags_of(broadcast(most) < some)) << i
            i += np.uint64(LANES)
        return word
    for at in range(start, len(heights)):
        word |= np.uint64(heights[at] < least or heights[at] > most) << i
        i += ONE
    return word


@kernel_part
def _count_end_bins(
    points: Points,
    cells: Array1D[np.uint32],
    heights: Array1D[np.float32],
    level: float,
    low: float,
    scale: float,
    lower: int,
    upper: int,
    count: Counts,
) -> None:
    """Count all points of the bins below `lower` and from `upper` on; counts in between are incomplete."""
    count[:] = 0
    bins, shift = count.shape[1] - 1, level - low
    near = bins * HEIGHT_ROUNDING
    least, most = np.float32((lower + near) / scale - shift), np.float32((upper - near) / scale - shift)
    for start in range(0, len(cells), CHUNK):
        word = _outside_mask(heights, start, least, most)
        while word != NONE:
            i = start + signed(lowest(word))
            word &= word - ONE
            if cells[i] == DROPPED:
                continue
            at = (float(heights[i]) + shift) * scale
            if abs(at - np.floor(at) - 0.5) > 0.5 - near:
                at = (points[3 * i + 2] - low) * scale
            count[0, min(bins - 1, int(at))] += 1


@kernel_part
def _dense_bins(count: Counts, sparse: float) -> tuple[int, int]:
    """Return the first and the last bin that are not sparse; first equals last if all are sparse."""
    first, last = 0, count.shape[1] - 2
    while first < last and count[:, first].sum() < sparse:
        first += 1
    while last > first and count[:, last].sum() < sparse:
        last -= 1
    return first, last


@kernel_part
def _kept_bins(count: Counts, sparse: float, n: int, threshold: float) -> tuple[int, int]:
    """Return the first and last bin that are kept."""
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


@kernel
def accepted_interval(
    points: Points,
    cells: Array1D[np.uint32],
    heights: Array1D[np.float32],
    level: float,
    low: float,
    high: float,
    n: int,
    bins: int,
    threshold: float,
) -> tuple[float, float]:
    """Return the accepted heights of n points not dropped (SLZ thesis, section 3.3.1.1).

    The sources give 300 bins and a threshold of 0.9, and do not say how the accepted interval is formed. Here
    an end bin is sparse when it holds less than (1 - threshold) of the mean bin population. Sparse end bins
    are trimmed, the emptier end first, while at least `threshold` of all points stay.

    No bin between two that are not sparse is trimmed. A sample suggests two such bins; then only the bins
    beyond are counted in full, with those two unless the sample alone proves them, and all bins if the sample
    misled. A height so near a bin's edge that rounding to float32 may move it across is looked up in float64.
    """
    if not high > low:
        return low, high
    count = np.empty((4, bins + 1), np.int32)  # four tables: successive increments of one bin need not wait
    scale, sparse = bins / (high - low), (1 - threshold) * n / bins
    guessed = False
    if n > SAMPLED_ABOVE:
        _count_by_bin(points, cells, heights, level, low, scale, SAMPLE_EVERY, count)
        first, last = _dense_bins(count, CLEARLY * sparse / SAMPLE_EVERY)
        sure_first, sure_last = count[:, first].sum() >= sparse, count[:, last].sum() >= sparse
        lower, upper = first + 1 - int(sure_first), last + int(sure_last)
        _count_end_bins(points, cells, heights, level, low, scale, lower, upper, count)
        count[0, first] += n * int(sure_first)
        count[0, last] += n * int(sure_last)
        guessed = count[0, first] >= sparse and count[0, last] >= sparse
    if not guessed:
        _count_by_bin(points, cells, heights, level, low, scale, 1, count)
    first, last = _kept_bins(count, sparse, n, threshold)
    return low + first / scale, low + (last + 1) / scale
