"""Zonal sums: over the cells of a zone and over its contour's content (SLZ paper, section 3.4.1)."""

from __future__ import annotations

from typing import Any

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D, Array4D, Strided2D
from slz.kernels.cells.cell_record import TILE, TILE_BITS
from slz.kernels.jit import kernel, kernel_for_any_types, kernel_part
from slz.kernels.raster.bitmap import NONE, ONE, Bits, popcount, signed, word_at

Sums = Array2D[np.float64]

# Statistics of a zone; those after SUM_SLOPE and SUM_ROUGHNESS are the numbers of summands.
N_SAFE, N_UNSAFE, SUM_CERTAINTY, SUM_SLOPE, N_SLOPE, SUM_ROUGHNESS, N_ROUGHNESS = range(7)
ZONAL_STATISTICS = 7


@kernel_part
def _add_finite(sums: Sums, of: int, values: Array1D[np.float32], first: np.uint64, cells: np.uint64) -> None:
    """Add the set and finite ones of 64 values, each to the sum of its bit, and count them."""
    for k in range(np.uint64(64)):
        value = np.float64(values[first + k])
        counts = ((cells >> k) & ONE != NONE) & (np.abs(value) < np.inf)
        sums[of, k] += value if counts else 0.0
        sums[of + 1, k] += 1.0 if counts else 0.0


@kernel_part
def _add_word(
    mine: np.uint64,
    inside: np.uint64,
    state: Array1D[np.uint8],
    certainty: Array1D[np.float32],
    slope: Array1D[np.float32],
    roughness: Array1D[np.float32],
    at: tuple[int, int, int, int],
    safe: np.uint8,
    unsafe: np.uint8,
    sums: Sums,
) -> np.uint64:
    """Add the statistics of 64 cells to sums, by statistic and bit; return the unsafe cells inside."""
    state_at, certainty_at = np.uint64(at[0]), np.uint64(at[1])
    good = bad = NONE
    for k in range(np.uint64(64)):
        good |= np.uint64(state[state_at + k] == safe) << k
        bad |= np.uint64(state[state_at + k] == unsafe) << k
    for k in range(np.uint64(64)):
        sure = np.float64(certainty[certainty_at + k])
        sums[SUM_CERTAINTY, k] += sure if (inside >> k) & ONE != NONE else 0.0
    if mine != NONE:
        _add_finite(sums, SUM_SLOPE, slope, np.uint64(at[2]), mine)
        _add_finite(sums, SUM_ROUGHNESS, roughness, np.uint64(at[3]), mine)
    sums[N_SAFE, 0] += signed(popcount(inside & good))
    sums[N_UNSAFE, 0] += signed(popcount(inside & bad))
    return inside & bad


@kernel
def count(cells: Strided2D[np.uint64]) -> int:
    """Return the number of set cells."""
    n = NONE
    for r in range(cells.shape[0]):
        for w in range(cells.shape[1]):
            n += popcount(cells[r, w])
    return signed(n)


@kernel
def common(cells: Strided2D[np.uint64], others: Strided2D[np.uint64], down: int, right: int) -> int:
    """Return the number of cells set in both of two bitmaps, the first one moved."""
    n = NONE
    for r in range(max(0, -down), min(cells.shape[0], others.shape[0] - down)):
        for w in range(cells.shape[1]):
            if cells[r, w] != NONE:
                n += popcount(cells[r, w] & word_at(others, r + down, 64 * w + right))
    return signed(n)


@kernel
def zonal_sums(
    own: Strided2D[np.uint64],
    content: Strided2D[np.uint64],
    state: Array2D[np.uint8],
    safe: np.uint8,
    unsafe: np.uint8,
    certainty: Array2D[np.float32],
    slope: Array2D[np.float32],
    roughness: Array2D[np.float32],
    statistics: Array1D[np.float64],
    holes: Strided2D[np.uint64],
) -> None:
    """Sum the maps of some rows of a zone, over the cells of whole words.

    Parameters
    ----------
    own, content
        Bitmaps of the cells of the zone, and of the cells on and inside its contour.
    state, safe, unsafe
        State of the cells, and its values for safe and unsafe.
    statistics
        (`ZONAL_STATISTICS`,) receives, for the content, the numbers of safe and unsafe cells and the sum of
        the certainty; for the zone's own cells, sums of the finite slopes and roughnesses, and how many are
        finite.
    holes
        Receives the unsafe cells of the content.
    """
    rows, words = content.shape
    flat_state, sure, steep, rough = state.ravel(), certainty.ravel(), slope.ravel(), roughness.ravel()
    sums = np.zeros((ZONAL_STATISTICS, 64))
    for r in range(rows):
        for w in range(words):
            if content[r, w] != NONE:
                at = 64 * (r * words + w)
                holes[r, w] = _add_word(
                    own[r, w], content[r, w], flat_state, sure, steep, rough, (at, at, at, at), safe, unsafe,
                    sums,
                )  # fmt: skip
    for of in range(ZONAL_STATISTICS):
        statistics[of] = sums[of].sum()


@kernel
def zonal_sums_of_tiles(
    layers: Array4D[np.float32],
    states: Array4D[np.uint8],
    table: Array2D[np.int32],
    wanted: Array2D[np.bool_],
    row0: int,
    certainty: int,
    slope: int,
    roughness: int,
    safe: np.uint8,
    unsafe: np.uint8,
    own: Bits,
    content: Bits,
    statistics: Array3D[np.float64],
    holes: Bits,
) -> None:
    """Compute `zonal_sums` for each wanted tile of a zone that is held.

    Parameters
    ----------
    layers, states, table
        As in `put_layers`; certainty, slope and roughness are indices of layers.
    own, content, holes
        Rows from row0 on, in words that are rows of tiles.
    statistics
        (rows of tiles, columns of tiles, `ZONAL_STATISTICS`).
    """
    flat, flat_states, cells = layers.ravel(), states.ravel(), TILE * TILE
    sums = np.zeros((ZONAL_STATISTICS, 64))
    for tr in range(table.shape[0]):
        south = ((row0 >> TILE_BITS) + tr) << TILE_BITS
        for tc in range(table.shape[1]):
            slot = table[tr, tc]
            if slot < 0 or not wanted[tr, tc]:
                continue
            sums[:] = 0.0
            held = slot * layers.shape[1]
            for r in range(max(row0, south), min(row0 + len(content), south + TILE)):
                inside = content[r - row0, tc]
                if inside != NONE:
                    at = TILE * (r - south)
                    holes[r - row0, tc] = _add_word(
                        own[r - row0, tc], inside, flat_states, flat, flat, flat,
                        (slot * cells + at, (held + certainty) * cells + at, (held + slope) * cells + at,
                         (held + roughness) * cells + at),
                        safe, unsafe, sums,
                    )  # fmt: skip
            for of in range(ZONAL_STATISTICS):
                statistics[tr, tc, of] = sums[of].sum()


@kernel_for_any_types
def _none(cells: Bits, first: int, stop: int, word: int) -> Any:
    """Return whether nothing is set in a word of some rows, which may be outside."""
    any_ = NONE
    if 0 <= word < cells.shape[1]:
        for r in range(max(0, first), min(len(cells), stop)):
            any_ |= cells[r, word]
    return any_ == NONE


@kernel_for_any_types
def _same(new: Bits, old: Bits, first: int, stop: int, down: int, word: int, right: int) -> Any:
    """Return whether a word of some rows is unchanged; outside the old rows nothing was set."""
    w, begin, end = word + right, max(first, -down), min(stop, len(old) - down)
    if w < 0 or w >= old.shape[1] or begin >= end:
        return _none(new, first, stop, word)
    other = NONE
    for r in range(begin, end):
        other |= new[r, word] ^ old[r + down, w]
    return other == NONE and _none(new, first, begin, word) and _none(new, end, stop, word)


@kernel
def carry_over(
    row0: int,
    versions: Array2D[np.int64],
    own: Bits,
    content: Bits,
    down: int,
    right: int,
    old_versions: Array2D[np.int64],
    old_own: Bits,
    old_content: Bits,
    old_statistics: Array3D[np.float64],
    old_holes: Bits,
    wanted: Array2D[np.bool_],
    statistics: Array3D[np.float64],
    holes: Bits,
) -> bool:
    """Copy earlier `zonal_sums_of_tiles` for unchanged tiles; return whether all tiles are unchanged.

    Parameters
    ----------
    versions
        Of the tiles: a new number after every write.
    down, right
        Rows and words to add to those of the zone to get those of its predecessor.
    wanted
        Receives False for tiles copied, and for those without content.
    """
    all_same, old_row0 = True, row0 - down
    tiles_down = (row0 >> TILE_BITS) - (old_row0 >> TILE_BITS)
    for tr in range(versions.shape[0]):
        south = ((row0 >> TILE_BITS) + tr) << TILE_BITS
        first, stop = max(row0, south) - row0, min(row0 + len(content), south + TILE) - row0
        for tc in range(versions.shape[1]):
            held = not _none(content, first, stop, tc)
            i, j = tr + tiles_down, tc + right
            same = 0 <= i < old_versions.shape[0] and 0 <= j < old_versions.shape[1]
            same = same and old_versions[i, j] == versions[tr, tc]
            for new, old in ((content, old_content), (own, old_own)):
                same = same and _same(new, old, first, stop, down, tc, right)
                same = same and _none(old, south - row0 + down, first + down, j)
                same = same and _none(old, stop + down, south + TILE - row0 + down, j)
            wanted[tr, tc] = held and not same
            all_same &= same or not held
            if held and same:
                for of in range(ZONAL_STATISTICS):
                    statistics[tr, tc, of] = old_statistics[i, j, of]
                for r in range(max(first, -down), min(stop, len(old_content) - down)):
                    holes[r, tc] = old_holes[r + down, j]
    return all_same
