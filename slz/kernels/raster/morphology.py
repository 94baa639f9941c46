"""Morphology with squares: dilation, erosion and closing of bitmaps, and the minimum filter."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Float32
from slz.kernels.jit import kernel, kernel_of_source_mode, kernel_part
from slz.kernels.raster.bitmap import LAST, NONE, ONE, Bits
from slz.kernels.simd import LANES, broadcast, load, store, where

Row = Array1D[np.float32]
Word = Array1D[np.uint64]
HIGHEST = np.float32(np.inf)


@kernel_part
def erode_columns(bits: Bits, by: int) -> None:
    """Keep the cells whose neighbour `by` columns to the east is also set, in place."""
    far, near = by >> 6, np.uint64(by & 63)
    rest = np.uint64(64) - near
    rows, words = bits.shape
    for r in range(rows):
        for w in range(words):
            if bits[r, w] == NONE:
                continue
            low = bits[r, w + far] if w + far < words else NONE
            if near != NONE:
                high = bits[r, w + far + 1] if w + far + 1 < words else NONE
                low = (low >> near) | (high << rest)
            bits[r, w] &= low


@kernel_part
def erode_rows(bits: Bits, by: int) -> None:
    """Keep the cells whose neighbour `by` rows to the north is also set, in place."""
    rows, words = bits.shape
    for r in range(rows):
        if r + by < rows:
            for w in range(words):
                bits[r, w] &= bits[r + by, w]
        else:
            bits[r] = NONE


@kernel
def erode_to_side(bits: Bits, side: int, wanted: int) -> None:
    """Reduce south-west corners of set squares of one side to those of a larger side, in place."""
    while side < wanted:
        step = min(side, wanted - side)
        erode_columns(bits, step)
        erode_rows(bits, step)
        side += step


@kernel_of_source_mode
def erode(
    safe: Bits, seeds: Bits, side: int, row0: int, row1: int, col0: int, col1: int
) -> tuple[int, int, int, int]:
    """Update the seeds, the south-west corners of safe squares, where the safe map changed.

    Parameters
    ----------
    row0, row1, col0, col1
        Box in which cells changed.

    Returns
    -------
    row0, row1, word0, word1 (half open) of the box in which seeds may have changed.
    """
    first, last = max(0, row0 - side + 1), row1
    word0, word1 = max(0, col0 - side + 1) >> 6, ((col1 - 1) >> 6) + 1
    reach = min(safe.shape[0], last + side - 1)
    wide = min(safe.shape[1], word1 + ((side + 62) >> 6))
    part = safe[first:reach, word0:wide].copy()
    erode_to_side(part, 1, side)
    for r in range(last - first):
        for w in range(word1 - word0):
            seeds[first + r, word0 + w] = part[r, w]
    return first, last, word0, word1


@kernel_part
def _clear_beyond(bits: Bits, cols: int) -> None:
    """Clear the bits of the last words that are beyond the last column."""
    if cols & 63:
        for r in range(bits.shape[0]):
            bits[r, -1] &= (ONE << np.uint64(cols & 63)) - ONE


@kernel_part
def _combine_shifted(words: Word, count: int, far: int, shift: int, all_: bool) -> None:
    """Combine words with those `far` words and `shift` bits ahead, in place: by AND, or by OR."""
    near, rest, first = np.uint64(shift), np.uint64(63 - shift), np.uint64(far)
    for w in range(np.uint64(count)):
        ahead = (words[w + first] >> near) | ((words[w + first + ONE] << ONE) << rest)
        words[w] = words[w] & ahead if all_ else words[w] | ahead


@kernel_part
def _squares_filter(bits: Bits, radius: int, cols: int, all_: bool) -> Bits:
    """Return the cells whose square of 2 radius + 1 cells is all set, or has any set; outside is not set.

    Rows and columns are shifted by the radius, so that a square starts at its centre's index.
    """
    rows, words = bits.shape
    side, far, near = 2 * radius + 1, radius >> 6, np.uint64(radius & 63)
    line, wide = np.zeros(words + 2 * far + 4, np.uint64), words + far + 1
    tall = np.zeros((rows + 2 * radius + 1) * words + 1, np.uint64)
    for r in range(rows):
        line[:] = NONE
        for w in range(words):
            line[w + far] |= bits[r, w] << near
            line[w + far + 1] = (bits[r, w] >> ONE) >> (LAST - near)
        have = 1
        while have < side:  # each bit covers `have` cells, itself and those to its east
            step = min(have, side - have)
            _combine_shifted(line, wide - (step >> 6), step >> 6, step & 63, all_)
            have += step
        for w in range(words):
            tall[(r + radius) * words + w] = line[w]
    have = 1
    while have < side:
        step = min(have, side - have)
        _combine_shifted(tall, (rows + 2 * radius - step) * words, step * words, 0, all_)
        have += step
    out = tall[: rows * words].copy().reshape(rows, words)
    _clear_beyond(out, cols)
    return out


@kernel
def dilated(bits: Bits, radius: int, cols: int) -> Bits:
    """Return the dilation by a square of 2 radius + 1 cells."""
    return _squares_filter(bits, radius, cols, False)


@kernel
def eroded(bits: Bits, radius: int, cols: int) -> Bits:
    """Return the erosion by a square of 2 radius + 1 cells; cells outside are not set."""
    return _squares_filter(bits, radius, cols, True)


@kernel
def closed(bits: Bits, radius: int, cols: int) -> Bits:
    """Return the closing by a square of 2 radius + 1 cells, with the outside unknown.

    Gaps narrower than the square are filled; the edge of the known ground is not moved outwards.
    """
    return bits | eroded(dilated(bits, radius, cols), radius, cols)


@kernel_part
def _beside(bits: Bits, row: int, word: int) -> np.uint64:
    """Return the cells of a word whose western and eastern neighbours are set."""
    west = bits[row, word - 1] >> LAST if word > 0 else NONE
    east = bits[row, word + 1] << LAST if word + 1 < bits.shape[1] else NONE
    own = bits[row, word]
    return np.uint64(((own << ONE) | west) & ((own >> ONE) | east))


@kernel
def enclosed(bits: Bits, cols: int) -> Bits:
    """Return the cells all of whose eight neighbours are set."""
    out = np.zeros_like(bits)
    for r in range(1, bits.shape[0] - 1):
        for w in range(bits.shape[1]):
            south, north = bits[r - 1, w] & _beside(bits, r - 1, w), bits[r + 1, w] & _beside(bits, r + 1, w)
            out[r, w] = _beside(bits, r, w) & south & north
    _clear_beyond(out, cols)
    return out


@kernel
def complement(bits: Bits, cols: int) -> Bits:
    """Return the complement: the cells that are not set."""
    out = ~bits
    _clear_beyond(out, cols)
    return out


@kernel
def above(values: Array2D[np.float32], limit: np.float32) -> Bits:
    """Return the cells whose value is above a limit; NaN is not above."""
    rows, cols = values.shape
    out = np.zeros((rows, (cols + 63) >> 6), np.uint64)
    for r in range(rows):
        for w in range(out.shape[1]):
            line, word = values[r, 64 * w : min(64 * w + 64, cols)], NONE
            for k in range(np.uint64(len(line))):
                word |= np.uint64(line[k] > limit) << k
            out[r, w] = word
    return out


@kernel
def exceeds(values: Array2D[np.float32], others: Array2D[np.float32], by: Float32) -> Bits:
    """Return the cells whose value exceeds the other value by more than a limit; NaN does not."""
    rows, cols = values.shape
    out = np.zeros((rows, (cols + 63) >> 6), np.uint64)
    for r in range(rows):
        for w in range(out.shape[1]):
            line, other, word = values[r, 64 * w : min(64 * w + 64, cols)], others[r, 64 * w :], NONE
            for k in range(np.uint64(len(line))):
                word |= np.uint64(line[k] - other[k] > by) << k
            out[r, w] = word
    return out


@kernel_part
def _row_minimum(
    values: Row, first: int, count: int, radius: int, away: int, rise: Float32, out: Row, at: int
) -> None:
    """Write the minimum over 2 radius + 1 values, `away` apart, each raised by `rise` per step away."""
    for c in range(0, count, LANES):
        least = load(values, first + c)
        for d in range(1, radius + 1):
            more, ahead, behind = broadcast(np.float32(rise * d)), first + c + d * away, first + c - d * away
            one, other = load(values, ahead), load(values, behind)
            best = where(one < other, one, other) + more
            least = where(best < least, best, least)
        store(out, at + c, least)


@kernel
def minimum_filter(values: Array2D[np.float32], radius: int, rise: Float32) -> Array2D[np.float32]:
    """Return the minimum over a square of 2 radius + 1 cells around every cell, NaN ignored.

    A value is raised by `rise` for every row and every column of its distance. Rows are padded to whole
    lanes; values beyond the columns are undefined.
    """
    rows, cols = values.shape
    width, flat = -(-cols // LANES) * LANES, values.ravel()
    line, wide = np.full(width + 2 * radius, HIGHEST), np.full((rows + 2 * radius) * width, HIGHEST)
    for r in range(rows):
        for c in range(0, cols - LANES + 1, LANES):
            some = load(flat, r * cols + c)
            store(line, radius + c, where(some == some, some, broadcast(HIGHEST)))
        for c in range(cols - cols % LANES, cols):
            line[radius + c] = values[r, c] if values[r, c] == values[r, c] else HIGHEST
        _row_minimum(line, radius, width, radius, 1, rise, wide, (radius + r) * width)
    out = np.empty((rows, width), np.float32)
    _row_minimum(wide, radius * width, rows * width, radius, width, rise, out.ravel(), 0)
    return out
