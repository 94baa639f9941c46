"""Zonal statistics of the source mode: counts and sums over a contour's content, word by word."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.paper.fuse import HALF, OLD
from slz.kernels.polygons.boundary_tracing import corner_indices
from slz.kernels.raster.bitmap import LAST, NONE, ONE, Bits, lowest, popcount, signed

Map = Array3D[np.float32]
Row = Array1D[np.float32]
Word = Array1D[np.uint64]
SUM_UNIT = np.float32(65536.0)  # sums are integers in units of 1 / 65536 degree
CHUNK = 64  # cells of a boundary
SIX = np.uint64(6)


@kernel_part
def _sum_of(values: Row, at: int, cells: np.uint64) -> np.int32:
    """Return the sum of the set ones of 64 values, from index `at` on, in units of 1 / SUM_UNIT."""
    total, first = np.int32(0), np.uint64(at)
    for i in range(np.uint64(64)):
        value = np.int32(values[first + i] * SUM_UNIT + HALF)
        total += value if (cells >> i) & ONE else np.int32(0)
    return total


@kernel_part
def _sum_of_few(values: Row, at: int, cells: np.uint64) -> np.int32:
    """Return the result of `_sum_of`, one set cell at a time."""
    total = np.int32(0)
    while cells != NONE:
        total += np.int32(values[np.uint64(at) + lowest(cells)] * SUM_UNIT + HALF)
        cells &= cells - ONE
    return total


@kernel  # fmt: skip
def zonal_statistics(
    content: Bits,
    safe: Bits,
    known: Bits,
    row0: int,
    word0: int,
    blocks: Array3D[np.int32],
    slope: Map,
    rough: Map,
    safe_inside: Bits,
    holes: Bits,
    blocks_held: Array2D[np.bool_],
) -> tuple[int, int, int, int]:
    """Return counts of safe and unknown cells of a content, and sums of slope and roughness of the safe ones.

    The sums are in units of 1 / SUM_UNIT. `blocks` caches them for whole words and is recomputed where it is
    OLD (see `fuse`). `safe_inside` receives the safe cells of the content, `holes` its known cells that are
    not safe. `blocks_held`, one flag for 64 rows of a word of the map, receives where the content is.
    """
    n_safe = n_unknown = np.uint64(0)
    slopes = roughs = 0
    slope_of, rough_of, rows = slope.ravel(), rough.ravel(), slope.shape[1]
    for i in range(content.shape[0]):
        r = row0 + i
        for j in range(content.shape[1]):
            inside, w = content[i, j], word0 + j
            if inside == NONE:
                safe_inside[i, j] = holes[i, j] = NONE
                continue
            blocks_held[(r >> 6) - (row0 >> 6), j] = True
            own = inside & safe[r, w]
            safe_inside[i, j] = own
            holes[i, j] = inside & known[r, w] & ~own
            n_safe += popcount(own)
            n_unknown += popcount(inside & ~known[r, w])
            if own == NONE:
                continue
            first, others = 64 * (w * rows + r), safe[r, w] & ~inside
            if popcount(own) < popcount(others):
                slopes += int(_sum_of_few(slope_of, first, own))
                roughs += int(_sum_of_few(rough_of, first, own))
                continue
            if blocks[r, w, 0] == OLD:
                blocks[r, w, 0], blocks[r, w, 1] = (
                    _sum_of(slope_of, first, safe[r, w]),
                    _sum_of(rough_of, first, safe[r, w]),
                )
            slopes += blocks[r, w, 0] - _sum_of_few(slope_of, first, others)
            roughs += blocks[r, w, 1] - _sum_of_few(rough_of, first, others)
    return signed(n_safe), signed(n_unknown), slopes, roughs


@kernel
def corners(
    boundary: Array2D[np.int32], height: Array1D[np.float32], west: float, south: float, cell: float
) -> Array2D[np.float64]:
    """Return (m, 3) east, north, height of the boundary cells that `corner_indices` keeps."""
    kept = corner_indices(boundary)
    out = np.empty((len(kept), 3))
    for k in range(len(kept)):
        i = kept[k]
        out[k, 0], out[k, 1] = west + (boundary[i, 1] + 0.5) * cell, south + (boundary[i, 0] + 0.5) * cell
        out[k, 2] = height[i]
    return out


@kernel_part
def _count_inside(boundary: Array1D[np.int32], content: Word, row0: int, col0: int, words: int) -> int:
    """Return how many cells are set in a bitmap that starts at (row0, col0) and covers all of them."""
    inside = NONE
    for i in range(np.uint64(len(boundary) >> 1)):
        r, c = np.uint64(boundary[2 * i] - row0), np.uint64(boundary[2 * i + ONE] - col0)
        inside += (content[r * np.uint64(words) + (c >> SIX)] >> (c & LAST)) & ONE
    return signed(inside)


@kernel
def inside_count(boundary: Array2D[np.int32], content: Bits, row0: int, col0: int, most_outside: int) -> int:
    """Return how many boundary cells are set in a bitmap from (row0, col0) on; -1 if too many are not.

    Consecutive cells are neighbours. So the first of a chunk decides whether the whole chunk is inside or
    outside the box, where it is far enough from the edge.
    """
    rows, words = content.shape
    cols, beyond, flat, steps = 64 * words, 0, content.ravel(), boundary.ravel()
    for start in range(0, len(boundary) - CHUNK, CHUNK):
        row, col = boundary[start, 0] - row0, boundary[start, 1] - col0
        beyond += not (-CHUNK < row < rows + CHUNK and -CHUNK < col < cols + CHUNK)
    if CHUNK * beyond > most_outside:
        return -1
    outside = 0
    for start in range(0, len(boundary), CHUNK):
        stop = min(start + CHUNK, len(boundary))
        row, col = boundary[start, 0] - row0, boundary[start, 1] - col0
        if CHUNK <= row < rows - CHUNK and CHUNK <= col < cols - CHUNK:
            outside += stop - start - _count_inside(steps[2 * start : 2 * stop], flat, row0, col0, words)
        elif not (-CHUNK < row < rows + CHUNK and -CHUNK < col < cols + CHUNK):
            outside += stop - start
        else:
            for i in range(start, stop):
                r, c = boundary[i, 0] - row0, boundary[i, 1] - col0
                held = 0 <= r < rows and 0 <= c < cols
                outside += not (held and content[r, c >> 6] >> np.uint64(c & 63) & ONE)
        if outside > most_outside:
            return -1
    return len(boundary) - outside
