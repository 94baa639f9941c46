"""Zonal sums: over the cells of a zone and over its contour's content (SLZ paper, section 3.4.1)."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D, Array4D, Strided2D
from slz.kernels.cells.cell_record import TILE, TILE_BITS
from slz.kernels.jit import kernel, kernel_part
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
def common(cells: Strided2D[np.uint64], others: Strided2D[np.uint64], down: int, right: int) -> int:
    """Return the number of cells set in both of two bitmaps, the first one moved."""
    n = NONE
    for r in range(max(0, -down), min(cells.shape[0], others.shape[0] - down)):
        for w in range(cells.shape[1]):
            if cells[r, w] != NONE and right & 63:
                n += popcount(cells[r, w] & word_at(others, r + down, 64 * w + right))
            elif 0 <= w + (right >> 6) < others.shape[1]:
                n += popcount(cells[r, w] & others[r + down, w + (right >> 6)])
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


@kernel_part
def carry_over(
    row0: int,
    versions: Strided2D[np.int64],
    own: Bits,
    content: Bits,
    down: int,
    right: int,
    old_versions: Strided2D[np.int64],
    old_own: Bits,
    old_content: Bits,
    old_statistics: Array3D[np.float64],
    old_holes: Bits,
    wanted: Array2D[np.bool_],
    same: Array2D[np.bool_],
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
    wanted, same
        Receive False for tiles copied, and for those without content; and whether a tile is unchanged.
    """
    all_same, first = True, row0 >> TILE_BITS
    for tr in range(versions.shape[0]):
        i, south = first + tr - ((row0 - down) >> TILE_BITS), ((first + tr) << TILE_BITS) - row0
        for tc in range(versions.shape[1]):
            j, any_inside, changed = tc + right, NONE, NONE
            known = 0 <= i < old_versions.shape[0] and 0 <= j < old_versions.shape[1]
            for r in range(south, south + TILE):
                mine = inside = NONE
                if 0 <= r < len(content):
                    mine, inside = own[r, tc], content[r, tc]
                any_inside |= inside
                if known and 0 <= r + down < len(old_content):
                    changed |= (mine ^ old_own[r + down, j]) | (inside ^ old_content[r + down, j])
                else:
                    changed |= mine | inside
            is_same = known and changed == NONE and old_versions[i, j] == versions[tr, tc]
            wanted[tr, tc], same[tr, tc] = any_inside != NONE and not is_same, is_same
            all_same &= is_same or any_inside == NONE
            if is_same and any_inside != NONE:
                for of in range(ZONAL_STATISTICS):
                    statistics[tr, tc, of] = old_statistics[i, j, of]
                for r in range(
                    max(south, 0, -down), min(south + TILE, len(content), len(old_content) - down)
                ):
                    holes[r, tc] = old_holes[r + down, j]
    return all_same


@kernel
def zonal_sums_of_tiles(
    layers: Array4D[np.float32],
    states: Array4D[np.uint8],
    table: Strided2D[np.int32],
    versions: Strided2D[np.int64],
    places: tuple[int, int, int],
    safe: np.uint8,
    unsafe: np.uint8,
    row0: int,
    own: Bits,
    content: Bits,
    down: int,
    right: int,
    old_versions: Strided2D[np.int64],
    old_own: Bits,
    old_content: Bits,
    old_statistics: Array3D[np.float64],
    old_holes: Bits,
) -> tuple[Array1D[np.float64], Bits, Array3D[np.float64], Array2D[np.bool_], bool]:
    """Return `zonal_sums` of a zone, with those of its tiles, which are `carry_over` where nothing changed.

    Parameters
    ----------
    layers, states, table, places
        As in `put_layers`; places are the indices of certainty, slope and roughness among the layers.
    own, content
        Rows from row0 on, in words that are rows of tiles.
    down, right and so on
        As in `carry_over`; without old tiles nothing is carried over.

    Returns
    -------
    The statistics; holes; (rows of tiles, columns of tiles, `ZONAL_STATISTICS`); tiles that are unchanged;
    whether all are that the content touches.
    """
    holes, statistics = np.zeros_like(content), np.zeros((*table.shape, ZONAL_STATISTICS))
    wanted, same = np.ones(table.shape, np.bool_), np.zeros(table.shape, np.bool_)
    unchanged = carry_over(
        row0, versions, own, content, down, right, old_versions, old_own, old_content, old_statistics,
        old_holes, wanted, same, statistics, holes,
    )  # fmt: skip
    flat, flat_states, cells, (certainty, slope, roughness) = layers.ravel(), states.ravel(), TILE**2, places
    sums, total = np.zeros((ZONAL_STATISTICS, 64)), np.zeros(ZONAL_STATISTICS)
    for tr in range(table.shape[0]):
        south = ((row0 >> TILE_BITS) + tr) << TILE_BITS
        for tc in range(table.shape[1]):
            slot = table[tr, tc]
            if slot >= 0 and wanted[tr, tc]:
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
            for of in range(ZONAL_STATISTICS):
                total[of] += statistics[tr, tc, of]
    return total, holes, statistics, same, unchanged
