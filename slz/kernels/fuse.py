"""One pass over the rows that a window hit: mean heights, slope, roughness, fusing, binary map.

The rows of a strip of heights and slopes roll along, so that nothing as large as the window is ever stored
but its sums (SLZ paper Eq. 5-9, §3.2.3-3.2.4).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.bits import ALL, GATHER, NONE, ONE, TOP, Bits
from slz.kernels.jit import kernel

Row = NDArray[np.float32]
Rows = NDArray[np.float32]
Map = NDArray[np.float32]

NAN, DEGREES, HALF = np.float32(np.nan), np.float32(57.29577951308232), np.float32(0.5)
F0, F1 = np.float32(0.0), np.float32(1.0)
TAN_1, TAN_3 = np.float32(0.4142135623730950), np.float32(2.414213562373095)  # of pi / 8 and 3 pi / 8
QUARTER, RIGHT = np.float32(np.pi / 4), np.float32(np.pi / 2)
A3, A5, A7, A9 = (
    np.float32(a) for a in (-3.33329491539e-1, 1.99777106478e-1, -1.38776856032e-1, 8.05374449538e-2)
)
SUM_UNIT = np.float32(65536.0)  # sums of slopes are whole numbers of 1 / 65536 degree
U0 = np.uint64(0)
STEP = 32  # cells that the compiler may take at a time
STRIP = 16  # rows of 64 cells of a map, a page of memory
RING = 20  # rows kept: those of a strip, and one to the south and two to the north
TWO_52, TWO_52_BITS = 2.0**52, np.uint64(0x4330000000000000)


@kernel("float32(float32)")
def atan(x: np.float32) -> np.float32:
    """Return the arc tangent of a number >= 0, to 2e-7 of it (Cephes' polynomial); NaN of NaN."""
    large, middle = x > TAN_3, x > TAN_1
    above = -F1 if large else (x - F1 if middle else x)
    below = x if large else (x + F1 if middle else F1)
    base = RIGHT if large else (QUARTER if middle else F0)
    r = above / below
    z = r * r
    return base + ((((A9 * z + A7) * z + A5) * z + A3) * z * r + r)


@kernel("UniTuple(int64, 2)(uint64[::1])")
def _span(sums: NDArray[np.uint64]) -> tuple[int, int]:
    """Return from where to where a row was hit, by whole STEPs of cells; 0, 0 where it was not."""
    first, stop = 0, len(sums)
    while first < stop and sums[first] == U0:
        first += 1
    if first == stop:
        return 0, 0
    while sums[stop - 1] == U0:
        stop -= 1
    return first // STEP * STEP, (stop + STEP - 1) // STEP * STEP


@kernel(
    "void(uint64[::1], float64, float64, uint64, uint64[::1], float64[::1], uint64[::1], float64[::1],"
    " float32[::1])"
)
def _mean_heights(
    sums: NDArray[np.uint64],
    low: float,
    unit: float,
    bits: np.uint64,
    counts: NDArray[np.uint64],
    real_counts: NDArray[np.float64],
    totals: NDArray[np.uint64],
    real_totals: NDArray[np.float64],
    height: Row,
) -> None:
    """Turn sums (see `sums.scatter`) into mean heights, NaN where nothing was hit (Eq. 5).

    The pairs of scratch are the same memory: a number with the exponent of 2**52 before it is that number
    plus 2**52, which the compiler does four at a time, unlike converting it.
    """
    mask = (np.uint64(1) << bits) - np.uint64(1)
    for i in range(np.uint64(len(sums))):
        counts[i] = (sums[i] & mask) | TWO_52_BITS
        totals[i] = (sums[i] >> bits) | TWO_52_BITS
    for i in range(np.uint64(len(sums))):
        n, total = real_counts[i] - TWO_52, real_totals[i] - TWO_52
        height[i] = np.float32(low + total * unit / n) if n > 0.0 else NAN


@kernel("void(float32[::1], float32[::1], float32[::1], float32, float32[::1])")
def _slopes(south: Row, here: Row, north: Row, k: np.float32, out: Row) -> None:
    """Return the slope of a row from its neighbours (Eq. 6-9), NaN where one is NaN.

    The rows of a step have a cell more at either end than `out`.
    """
    west, east, mid, below, above = here[:-2], here[2:], here[1:-1], south[1:-1], north[1:-1]
    for i in range(np.uint64(len(out))):
        dx, dy = (east[i] - west[i]) * k, (above[i] - below[i]) * k
        angle = atan(np.sqrt(dx * dx + dy * dy)) * DEGREES
        out[i] = angle if mid[i] == mid[i] else NAN


@kernel(
    "void(float32[:, ::1], float32[:, ::1], float32[:, ::1], int64, int64, float32, float32, boolean, int64,"
    " int64, int64, int64, float32[:, :, ::1], float32[:, :, ::1], float32[:, :, ::1], uint8[::1],"
    " uint8[::1])"
)
def _join(
    height: Rows,
    slope: Rows,
    rough: Rows,
    line: int,
    at: int,
    worst: np.float32,
    safe_slope: np.float32,
    greatest: bool,
    word: int,
    row: int,
    first: int,
    stop: int,
    total_height: Map,
    total_slope: Map,
    total_rough: Map,
    safe: NDArray[np.uint8],
    known: NDArray[np.uint8],
) -> None:
    """Join cells of a row of a window, from one on, with those of a word of the total maps (§3.2.3).

    By mean or maximum. Indices that cannot be negative, so that the compiler takes eight at a time.
    """
    w, r, n, from_ = np.uint64(word), np.uint64(row), np.uint64(line), np.uint64(at)
    to, most = np.uint64(first), np.uint64(stop)
    for i in range(most - to):
        h, s, q, c = height[n, from_ + i], slope[n, from_ + i], rough[n, from_ + i], to + i
        old_h, old_s, old_r = total_height[w, r, c], total_slope[w, r, c], total_rough[w, r, c]
        write, fresh = s < worst, old_s >= worst
        joint_s = (s if s > old_s else old_s) if greatest else HALF * (old_s + s)
        joint_h = (h if h > old_h else old_h) if greatest else HALF * (old_h + h)
        joint_r = (q if q > old_r else old_r) if greatest else HALF * (old_r + q)
        new_s = (s if fresh else joint_s) if write else old_s
        new_h = (h if fresh else joint_h) if write else old_h
        new_r = (q if fresh | (old_r == worst) else joint_r) if write & (q == q) else old_r
        total_slope[w, r, c], total_height[w, r, c], total_rough[w, r, c] = new_s, new_h, new_r
        safe[c] = np.uint8(new_s < safe_slope)
        known[c] = np.uint8(new_h == new_h)


@kernel("uint64(uint64[::1])")
def _word(eights: NDArray[np.uint64]) -> np.uint64:
    """Return 64 bytes of 0 and 1 as bits."""
    word = NONE
    for b in range(np.uint64(8)):
        word |= ((eights[b] * GATHER) >> TOP) << (b * np.uint64(8))
    return word


@kernel("int32(float32[:, :, ::1], float32[:, :, ::1], int64, int64, float32)")
def _safe_sum(slope: Map, values: Map, word: int, row: int, safe_slope: np.float32) -> np.int32:
    """Return the sum of the values of the safe ones of 64 cells, in units of 1 / SUM_UNIT."""
    total, w, r = np.int32(0), np.uint64(word), np.uint64(row)
    for i in range(np.uint64(64)):
        safe = slope[w, r, i] < safe_slope
        total += np.int32(values[w, r, i] * SUM_UNIT + HALF) if safe else np.int32(0)
    return total


@kernel(
    "void(float32[:, :, ::1], float32[:, :, ::1], uint64, float32, int64, int64, int64, int32[:, :, ::1])"
)
def _add_up(
    slope: Map,
    rough: Map,
    safe: np.uint64,
    safe_slope: np.float32,
    row: int,
    word: int,
    cols: int,
    blocks: NDArray[np.int32],
) -> None:
    """Bring the sums of a word's safe cells up to date."""
    blocks[row, word, 0], blocks[row, word, 1] = 0, 0
    if safe == NONE:
        return
    blocks[row, word, 0] = _safe_sum(slope, slope, word, row, safe_slope)
    blocks[row, word, 1] = _safe_sum(slope, rough, word, row, safe_slope)
    for c in (0, cols - 1):  # not safe, however level
        if c >> 6 == word and slope[word, row, c & 63] < safe_slope:
            blocks[row, word, 0] -= np.int32(slope[word, row, c & 63] * SUM_UNIT + HALF)
            blocks[row, word, 1] -= np.int32(rough[word, row, c & 63] * SUM_UNIT + HALF)


@kernel(
    "void(float32[:, ::1], float32[:, ::1], float32[:, ::1], int64[:, ::1], int64, int64, int64, int64,"
    " int64, float32, float32, boolean, float32[:, :, ::1], float32[:, :, ::1], float32[:, :, ::1],"
    " uint8[:, ::1], uint64[:, ::1], uint64[:, ::1], int32[:, :, ::1], uint8[::1], uint8[::1],"
    " uint64[::1], uint64[::1], int64[::1])"
)
def _join_strip(
    heights: Rows,
    slopes: Rows,
    roughs: Rows,
    ends: NDArray[np.int64],
    start: int,
    stop: int,
    row0: int,
    col0: int,
    cols: int,
    worst: np.float32,
    safe_slope: np.float32,
    greatest: bool,
    height: Map,
    slope: Map,
    rough: Map,
    begun: NDArray[np.uint8],
    safe: Bits,
    known: Bits,
    blocks: NDArray[np.int32],
    safe_bytes: NDArray[np.uint8],
    known_bytes: NDArray[np.uint8],
    safe_eights: NDArray[np.uint64],
    known_eights: NDArray[np.uint64],
    changed: NDArray[np.int64],
) -> None:
    """Join rows start to stop of a window with the total maps, word by word: so each page is met once.

    What changed of the safe map is noted: first and last row, first and last word.
    """
    west, east = heights.shape[1], 0
    for j in range(start, stop):
        if ends[j % RING, 1] > 0:
            west, east = min(west, ends[j % RING, 0]), max(east, ends[j % RING, 1])
    for c in range((col0 + west) >> 6, ((col0 + east - 1) >> 6) + 1):
        before = 64 * c - col0  # columns of the box before this word
        for j in range(start, stop):
            r, line = row0 + j, j % RING
            left, right = max(0, ends[line, 0] - before), min(64, ends[line, 1] - before)
            if left >= right:
                continue
            if not begun[r, c]:
                begun[r, c] = 1
                for i in range(64):
                    height[c, r, i], slope[c, r, i], rough[c, r, i] = NAN, worst, worst
            _join(
                heights, slopes, roughs, line, before + left + 1, worst, safe_slope, greatest, c, r, left,
                right, height, slope, rough, safe_bytes, known_bytes,
            )  # fmt: skip
            mask = (ALL << np.uint64(left)) & (ALL >> np.uint64(64 - right))
            old, safe_mask = safe[r, c], mask
            if r == 0 or r == safe.shape[0] - 1:
                safe_mask = NONE
            if c == 0:
                safe_mask &= ~ONE
            if c == (cols - 1) >> 6:
                safe_mask &= ~(ONE << np.uint64((cols - 1) & 63))
            word = (old & ~mask) | (_word(safe_eights) & safe_mask)
            known[r, c] = (known[r, c] & ~mask) | (_word(known_eights) & mask)
            if word != old:
                safe[r, c] = word
                changed[0], changed[1] = min(changed[0], r), max(changed[1], r)
                changed[2], changed[3] = min(changed[2], c), max(changed[3], c)
            _add_up(slope, rough, word, safe_slope, r, c, cols, blocks)


@kernel(
    "UniTuple(int64, 4)(uint64[::1], int64, int64, int64, int64, int64, float64, float64, int64, float64,"
    " float32, float32, boolean, float32[:, :, ::1], float32[:, :, ::1], float32[:, :, ::1], uint8[:, ::1],"
    " uint64[:, ::1], uint64[:, ::1], int32[:, :, ::1])"
)
def fuse(
    sums: NDArray[np.uint64],
    row0: int,
    col0: int,
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
    begun: NDArray[np.uint8],
    safe: Bits,
    known: Bits,
    blocks: NDArray[np.int32],
) -> tuple[int, int, int, int]:
    """Fuse the sums of a window, rows x width cells from (row0, col0) on, with the total maps.

    Parameters
    ----------
    sums
        (rows * width,) as `sums.scatter` leaves them. The width is a multiple of STEP; the box may reach
        beyond the map's last column by less than that.
    cols
        Columns of the map; the arrays are as wide as the next multiple of 64, and 64 more.
    height, slope, rough
        (words, rows, 64) total maps, cell (r, c) at [c >> 6, r, c & 63]: so what lies together on the ground
        does so in memory. NaN and the worst case where nothing was written, in words that are `begun`.
    begun
        (rows, words) 1 where something was written to a word.
    safe, known
        Bit maps: slope below `safe_slope` but on the map's margin (§3.2.4), and any height.
    blocks
        (rows, words, 2) sums of slope and roughness of the safe cells of each word, see SUM_UNIT.

    Returns
    -------
    row0, row1, col0, col1 of the cells whose safety changed, columns by whole words; row1 0 where none did.
    """
    k = np.float32(1.0 / (2.0 * cell))
    heights, slopes, roughs = (  # a margin at either end
        np.full((RING, width + 2), NAN), np.full((RING, width + 2), NAN), np.full((RING, width + 2), NAN),
    )  # fmt: skip
    safe_bytes, known_bytes = np.zeros(64, np.uint8), np.zeros(64, np.uint8)
    safe_eights, known_eights = safe_bytes.view(np.uint64), known_bytes.view(np.uint64)
    counts, totals = np.empty(width, np.uint64), np.empty(width, np.uint64)
    real_counts, real_totals = counts.view(np.float64), totals.view(np.float64)
    bits, ends, start = np.uint64(count_bits), np.zeros((RING, 2), np.int64), 1
    changed = np.array([safe.shape[0], -1, safe.shape[1], -1])
    for i in range(rows + 2):
        new = i % RING
        ends[new, 0] = ends[new, 1] = 0
        if i < rows:
            row = sums[i * width : (i + 1) * width]
            a, b = _span(row)
            ends[new, 0], ends[new, 1] = a, b
            heights[new, : a + 1], heights[new, b + 1 :] = NAN, NAN
            _mean_heights(
                row[a:b],
                low,
                unit,
                bits,
                counts,
                real_counts,
                totals,
                real_totals,
                heights[new, a + 1 : b + 1],
            )
        j = i - 1
        if j >= 0:
            a, b = ends[j % RING]
            slopes[j % RING] = NAN
            if 0 < j < rows - 1 and b > a:
                _slopes(
                    heights[(j - 1) % RING, a : b + 2], heights[j % RING, a : b + 2],
                    heights[new, a : b + 2], k, slopes[j % RING, a + 1 : b + 1],
                )  # fmt: skip
        j = i - 2
        if j < 1 or j >= rows - 1:
            continue
        a, b = ends[j % RING]
        if b > a:
            _slopes(
                slopes[(j - 1) % RING, a : b + 2], slopes[j % RING, a : b + 2],
                slopes[(j + 1) % RING, a : b + 2], k, roughs[j % RING, a + 1 : b + 1],
            )  # fmt: skip
        if j == rows - 2 or (row0 + j) % STRIP == STRIP - 1:
            _join_strip(
                heights, slopes, roughs, ends, start, j + 1, row0, col0, cols, worst, safe_slope, greatest,
                height, slope, rough, begun, safe, known, blocks, safe_bytes, known_bytes, safe_eights,
                known_eights, changed,
            )  # fmt: skip
            start = j + 1
    if changed[1] < 0:
        return 0, 0, 0, 0
    return changed[0], changed[1] + 1, 64 * changed[2], 64 * (changed[3] + 1)


@kernel(
    "void(int64, int64, int64, int64, int64, float32, float32[:, :, ::1], float32[:, :, ::1],"
    " float32[:, :, ::1], uint64[:, ::1], uint64[:, ::1], int32[:, :, ::1])"
)
def refresh(
    row0: int,
    row1: int,
    word0: int,
    word1: int,
    cols: int,
    safe_slope: np.float32,
    height: Map,
    slope: Map,
    rough: Map,
    safe: Bits,
    known: Bits,
    blocks: NDArray[np.int32],
) -> None:
    """Make the bit maps and sums of a box of words from maps that were copied (see `fuse`)."""
    for r in range(row0, row1):
        inner = 0 < r < safe.shape[0] - 1
        for w in range(word0, word1):
            safe[r, w], known[r, w] = NONE, NONE
            for c in range(64 * w, min(cols, 64 * w + 64)):
                mark = np.uint64(1) << np.uint64(c & 63)
                if inner and 0 < c < cols - 1 and slope[w, r, c & 63] < safe_slope:
                    safe[r, w] |= mark
                if height[w, r, c & 63] == height[w, r, c & 63]:
                    known[r, w] |= mark
            _add_up(slope, rough, safe[r, w], safe_slope, r, w, cols, blocks)
