"""Fusion of a window with the total maps in one pass: mean heights, slope, roughness, binary map.

A ring buffer of rows holds the heights and slopes, so that only the sums are stored for the whole window
(SLZ paper, sections 3.2.1-3.2.4).
"""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D
from slz.kernels.elementary_functions import arctangent
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.raster.bitmap import LAST, NONE, ONE, Bits
from slz.kernels.simd import LANES, broadcast, load, sqrt, store, where

Row = Array1D[np.float32]
Word = Array1D[np.uint64]
Map = Array3D[np.float32]

NAN, DEGREES, HALF = np.float32(np.nan), np.float32(57.29577951308232), np.float32(0.5)
F0, F1 = np.float32(0.0), np.float32(1.0)
INFINITE = np.float32(np.inf)
WORD = 64  # cells of a word of the maps
LANE_MASK = np.uint64((1 << LANES) - 1)
OLD = -1  # value in `blocks`: to be recomputed
STRIP = 16  # rows of 64 float32 cells of a map: one page of memory
RING = 20  # rows of the ring buffer: a strip, and at least one row to the south and two to the north
TWO_52, TWO_52_BITS = 2.0**52, np.uint64(0x4330000000000000)


@kernel_part
def _mask_below(values: Row, at: int, limit: np.float32) -> np.uint64:
    """Return a bit mask of 64 values, from index `at` on: 1 where below the limit; 0 for NaN."""
    word = NONE
    for k in range(np.uint64(WORD)):
        word |= np.uint64(values[np.uint64(at) + k] < limit) << k
    return word


@kernel_part
def _hit_span(sums: Array1D[np.uint64]) -> tuple[int, int]:
    """Return the range of columns of a row that was hit, in whole words; 0, 0 for none."""
    first, stop = 0, len(sums)
    while first < stop and sums[first] == NONE:
        first += 1
    if first == stop:
        return 0, 0
    while sums[stop - 1] == NONE:
        stop -= 1
    return first // WORD * WORD, -(-stop // WORD) * WORD


@kernel_part
def _mean_heights(
    sums: Array1D[np.uint64],
    low: float,
    unit: float,
    bits: np.uint64,
    counts: Array1D[np.uint64],
    totals: Array1D[np.uint64],
    height: Row,
) -> None:
    """Convert sums (see `height_sums.sum_heights`) to mean heights, NaN where nothing was hit.

    An integer OR-ed with the exponent bits of 2**52 reads as a float64 equal to it plus 2**52. The compiler
    vectorises this, but not the conversion. counts, totals: scratch.
    """
    real_counts, real_totals = counts.view(np.float64), totals.view(np.float64)
    mask = (np.uint64(1) << bits) - np.uint64(1)
    for i in range(np.uint64(len(sums))):
        counts[i] = (sums[i] & mask) | TWO_52_BITS
        totals[i] = (sums[i] >> bits) | TWO_52_BITS
    for i in range(np.uint64(len(sums))):
        n, total = real_counts[i] - TWO_52, real_totals[i] - TWO_52
        height[i] = np.float32(low + total * unit / n) if n > 0.0 else NAN  # SLZ paper, Eq. (5)


@kernel_part
def _with_all_neighbours(held: Bits, south: int, here: int, north: int, out: Bits) -> None:
    """Write the cells of a row that are set with all four neighbours; the outermost words are margin."""
    for w in range(1, held.shape[1] - 1):
        row = held[here, w]
        east, west = (row >> ONE) | (held[here, w + 1] << LAST), (row << ONE) | (held[here, w - 1] >> LAST)
        out[here, w] = row & east & west & held[south, w] & held[north, w]


@kernel_part
def _row_slopes(
    values: Row, south: int, here: int, north: int, cells: int, wanted: Word, k: np.float32, out: Row
) -> None:
    """Write the slopes of a row, NaN where the cell is NaN.

    The gradient is SLZ paper, Eq. (6). Lanes without a wanted cell are NaN; the neighbours of a wanted cell
    all have a value.

    Parameters
    ----------
    south, here, north
        Index of the first of `cells` cells in each row; each row has one more cell at either end.
    """
    scale, degrees, nothing = broadcast(k), broadcast(DEGREES), broadcast(NAN)
    for i in range(0, cells, LANES):
        at = here + i
        if (wanted[(i >> 6) + 1] >> np.uint64(i & 63)) & LANE_MASK == NONE:
            store(out, at, nothing)
            continue
        mid = load(values, at)
        dx = (load(values, at + 1) - load(values, at - 1)) * scale  # SLZ paper, Eq. (7)
        dy = (load(values, north + i) - load(values, south + i)) * scale  # SLZ paper, Eq. (8)
        angle = arctangent(sqrt(dx * dx + dy * dy)) * degrees  # SLZ paper, Eq. (9)
        store(out, at, where(mid == mid, angle, nothing))


@kernel_part
def _fuse_word(
    height: Row,
    slope: Row,
    at: int,
    worst: np.float32,
    greatest: bool,
    total_height: Row,
    total_slope: Row,
    to: int,
) -> None:
    """Fuse a word of a window's row with the total maps, by mean or maximum (SLZ paper, section 3.2.3).

    Where the window writes nothing the old value is fused with itself, which leaves it unchanged. With a
    final choice instead, the compiler would emit masked stores, which some processors do one number at a
    time.
    """
    for k in range(np.uint64(WORD)):
        i, j = np.uint64(at) + k, np.uint64(to) + k
        old_h, old_s, h, s = total_height[j], total_slope[j], height[i], slope[i]
        h, s = h if s < worst else old_h, s if s < worst else old_s
        if greatest:
            joint_h, joint_s = h if old_h < h else old_h, s if old_s < s else old_s
        else:
            joint_h, joint_s = HALF * (old_h + h), HALF * (old_s + s)
        total_slope[j] = joint_s if old_s < worst else s
        total_height[j] = joint_h if old_s < worst else h


@kernel_part
def _fuse_roughness(
    rough: Row,
    slope: Row,
    at: int,
    worst: np.float32,
    greatest: bool,
    total_rough: Row,
    to: int,
) -> None:
    """Fuse the roughness of a word, known in fewer cells than the slope; unknown is the worst case."""
    for k in range(np.uint64(WORD)):
        i, j = np.uint64(at) + k, np.uint64(to) + k
        q, old = rough[i], total_rough[j]
        q = q if (slope[i] < worst) & (q == q) else old
        joint = (q if old < q else old) if greatest else HALF * (old + q)
        total_rough[j] = q if old == worst else joint


@kernel_part
def _off_margin(rows: int, cols: int, row: int, word: int) -> np.uint64:
    """Return a mask of a word's cells off the margin, which is never safe (SLZ paper, section 3.2.4)."""
    if row == 0 or row == rows - 1:
        return NONE
    mask = ~ONE if word == 0 else ~NONE
    return mask & ~(ONE << np.uint64((cols - 1) & 63)) if word == (cols - 1) >> 6 else mask


@kernel_part
def _fuse_strip(
    values: Map,
    marks: Array3D[np.uint64],
    start: int,
    stop: int,
    row0: int,
    word0: int,
    cols: int,
    worst: np.float32,
    safe_slope: np.float32,
    greatest: bool,
    total: tuple[Map, Map, Map, Array2D[np.uint8], Bits, Bits, Array3D[np.int32]],
    changed: Array1D[np.int64],
) -> None:
    """Fuse rows start to stop of a window with the total maps, word by word, so that each page is met once.

    values, marks: of the rows in the ring, height, slope and roughness, and where they are. total: as in
    `fuse`. `changed` receives the extent of the changes of the safe map: first and last row and word.
    """
    height, slope, rough, begun, safe, known, blocks = total
    rows, cells, sloped, roughened = height.shape[1], values.shape[2], marks[1], marks[2]
    window_h, window_s, window_r = values[0].ravel(), values[1].ravel(), values[2].ravel()
    total_h, total_s, total_r = height.ravel(), slope.ravel(), rough.ravel()
    for w in range(sloped.shape[1] - 2):
        c = word0 + w
        for j in range(start, stop):
            r, line = row0 + j, j % RING
            if sloped[line, w + 1] == NONE:
                continue
            at, to = line * cells + WORD * w + 1, (c * rows + r) * WORD
            if not begun[r, c]:
                begun[r, c] = 1
                total_h[to : to + WORD] = NAN
                total_s[to : to + WORD] = worst
                total_r[to : to + WORD] = worst
            _fuse_word(window_h, window_s, at, worst, greatest, total_h, total_s, to)
            if roughened[line, w + 1] != NONE:
                _fuse_roughness(window_r, window_s, at, worst, greatest, total_r, to)
            known[r, c] |= _mask_below(window_s, at, worst)
            word = _mask_below(total_s, to, safe_slope) & _off_margin(rows, cols, r, c)
            blocks[r, c, 0] = OLD
            if word != safe[r, c]:
                safe[r, c] = word
                changed[0], changed[1] = min(changed[0], r), max(changed[1], r)
                changed[2], changed[3] = min(changed[2], c), max(changed[3], c)


@kernel
def fuse(
    sums: Array1D[np.uint64],
    row0: int,
    word0: int,
    rows: int,
    width: int,
    cols: int,
    low: float,
    unit: float,
    count_bits: int,
    cell: float,
    worst: np.float32,
    safe_slope: np.float32,
    greatest: bool,
    height: Map,
    slope: Map,
    rough: Map,
    begun: Array2D[np.uint8],
    safe: Bits,
    known: Bits,
    blocks: Array3D[np.int32],
) -> tuple[int, int, int, int]:
    """Fuse the sums of a window, rows x width cells from (row0, 64 word0) on, with the total maps.

    Parameters
    ----------
    sums
        (rows * width,) as written by `height_sums.sum_heights`; the width is in whole words.
    cols
        Columns of the map; the arrays are as wide as the next multiple of 64, plus 64.
    height, slope, rough
        (words, rows, 64) total maps, cell (r, c) at [c >> 6, r, c & 63], so that neighbours on the ground are
        neighbours in memory. NaN and the worst case where nothing was written, in words that are `begun`.
    begun
        (rows, words) 1 where something was written to a word.
    safe, known
        Bitmaps: slope below `safe_slope` and off the map's margin (SLZ paper, section 3.2.4), and any height.
    blocks
        (rows, words, 2) sums of slope and roughness of the safe cells of each word, see
        `zone_statistics.zonal_statistics`; set to OLD for words that are written.

    Returns
    -------
    row0, row1, col0, col1 of the cells whose safety changed, columns in whole words; all 0 for none.
    """
    k = np.float32(1.0 / (2.0 * cell))
    words, line = width // WORD, width + 2  # a margin at either end
    values, marks = np.full((3, RING, line), NAN), np.zeros((3, RING, words + 2), np.uint64)
    heights, slopes, roughs = values[0], values[1], values[2]
    hit, sloped, roughened = marks[0], marks[1], marks[2]
    flat, flat_slopes, flat_roughs = heights.ravel(), slopes.ravel(), roughs.ravel()
    counts, totals = np.empty(width, np.uint64), np.empty(width, np.uint64)
    bits, start, changed = np.uint64(count_bits), 1, np.array([safe.shape[0], -1, safe.shape[1], -1])
    for i in range(rows + 2):
        new, south, here, north = i % RING, (i - 2) % RING, (i - 1) % RING, i % RING
        if i < rows:
            row = sums[i * width : (i + 1) * width]
            a, b = _hit_span(row)
            heights[new, : a + 1], heights[new, b + 1 :] = NAN, NAN
            _mean_heights(row[a:b], low, unit, bits, counts, totals, heights[new, a + 1 : b + 1])
            for w in range(words):
                hit[new, w + 1] = _mask_below(flat, new * line + WORD * w + 1, INFINITE)
        if 0 < i - 1 < rows - 1:
            _with_all_neighbours(hit, south, here, north, sloped)
            _row_slopes(
                flat, south * line + 1, here * line + 1, north * line + 1, width, sloped[here], k, flat_slopes
            )
        else:
            sloped[here, :] = NONE
        j = i - 2
        if j < 1 or j >= rows - 1:
            continue
        south, here, north = (j - 1) % RING, j % RING, (j + 1) % RING
        _with_all_neighbours(sloped, south, here, north, roughened)
        _row_slopes(
            flat_slopes, south * line + 1, here * line + 1, north * line + 1, width, roughened[here], k,
            flat_roughs,
        )  # fmt: skip
        if j == rows - 2 or (row0 + j) % STRIP == STRIP - 1:
            _fuse_strip(
                values, marks, start, j + 1, row0, word0, cols, worst, safe_slope, greatest,
                (height, slope, rough, begun, safe, known, blocks), changed,
            )  # fmt: skip
            start = j + 1
    if changed[1] < 0:
        return 0, 0, 0, 0
    return changed[0], changed[1] + 1, 64 * changed[2], 64 * (changed[3] + 1)


@kernel
def refresh(
    row0: int,
    row1: int,
    word0: int,
    word1: int,
    cols: int,
    safe_slope: np.float32,
    height: Map,
    slope: Map,
    safe: Bits,
    known: Bits,
    blocks: Array3D[np.int32],
) -> None:
    """Recompute the bitmaps of a box of words from copied maps (see `fuse`)."""
    flat_slope, flat_height, rows = slope.ravel(), height.ravel(), slope.shape[1]
    for w in range(word0, word1):
        for r in range(row0, row1):
            at = (w * rows + r) * WORD
            safe[r, w] = _mask_below(flat_slope, at, safe_slope) & _off_margin(rows, cols, r, w)
            known[r, w] = _mask_below(flat_height, at, INFINITE)
            blocks[r, w, 0] = OLD
