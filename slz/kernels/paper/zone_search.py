"""Zone search: components that hold a safe square (SLZ paper, section 3.3 and Algorithm 1)."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.array_memory import doubled, put, put_rows
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.polygons.boundary_tracing import extent, trace_boundary, westmost
from slz.kernels.raster.bitmap import NONE, Bits, lowest, signed
from slz.kernels.raster.region_fill import component, fill

# Columns of the table of components.
ROW0, ROW1, COL0, COL1, N_CELLS, N_BOUNDARY, BOUNDARY_AT, CONTENT_AT = range(8)
COMPONENT_FIELDS = 8


@kernel_part
def _doubled_trace(
    path: Array2D[np.int32], edges: Array1D[np.uint8], used: int
) -> tuple[Array2D[np.int32], Array1D[np.uint8]]:
    new_edges = np.empty(2 * len(edges), np.uint8)
    put(new_edges, 0, edges[:used])
    return doubled(path), new_edges


@kernel_part
def _first_step(path: Array2D[np.int32], edges: Array1D[np.uint8], n: int, first: int) -> int:
    """Return the index at which a trace leaves its first cell as a trace started there would."""
    row, col = path[first, 0], path[first, 1]
    start, best = first, 9
    for i in range(first, n):
        if path[i, 0] == row and path[i, 1] == col:
            direction = signed(edges[i]) & 15
            if 4 <= direction < best:  # nothing precedes the first cell, so the search starts at east
                start, best = i, direction
    return start


@kernel_part
def _mark_taken(taken: Bits, content: Bits, row0: int, word0: int) -> None:
    for i in range(content.shape[0]):
        for j in range(content.shape[1]):
            taken[row0 + i, word0 + j] |= content[i, j]


@kernel_part
def _next_seed(
    seeds: Bits, taken: Bits, row: int, word: int, row1: int, word0: int, word1: int
) -> tuple[int, int]:
    """Return the first word, in raster order from one on, with a seed not taken; row1 for none.

    A separate kernel, because a loop in which arrays are made counts references at every step.
    """
    while row < row1:
        while word < word1:
            if seeds[row, word] & ~taken[row, word] != NONE:
                return row, word
            word += 1
        row, word = row + 1, word0
    return row1, word0


@kernel
def search_zones(
    safe: Bits,
    seeds: Bits,
    taken: Bits,
    row0: int,
    row1: int,
    word0: int,
    word1: int,
    least: int,
    longest: int,
) -> tuple[Array2D[np.int64], Array2D[np.int32], Array1D[np.uint64], Array1D[np.int64]]:
    """Return the components with a free seed in a box and a boundary of at least `least` cells.

    Parameters
    ----------
    safe
        Binary map; nothing is set on its margin.
    seeds
        South-west corners of safe squares.
    taken
        Seeds not to start from. Receives the content of the returned components, and the too short
        components.
    longest
        Initial length of the trace buffer; a longer boundary is traced again.

    Returns
    -------
    Table with the columns above; all boundaries, each from its first cell; all contents, each (ROW1 - ROW0)
    rows of words from COL0 >> 6 to (COL1 - 1) >> 6; row0, row1, word0, word1 (half open) of the box in which
    `taken` changed.
    """
    path, edges = np.empty((longest, 2), np.int32), np.empty(longest, np.uint8)
    spread = np.array([row1, row0, word1, word0], np.int64)
    table, count = np.empty((16, COMPONENT_FIELDS), np.int64), 0
    boundary, n_boundary = np.empty((0, 2), np.int32), 0
    words, n_words = np.empty(0, np.uint64), 0
    row, w = _next_seed(seeds, taken, row0, word0, row1, word0, word1)
    while row < row1:
        r, c = row, 64 * w + signed(lowest(seeds[row, w] & ~taken[row, w]))
        while True:  # west to an edge; the trace of a hole is followed to its first cell, farther south
            n, area = trace_boundary(safe, r, westmost(safe, r, c), path, edges)
            if n > len(path):
                path, edges = _doubled_trace(path, edges, 0)
                continue
            r0, r1, c0, c1, first = extent(path, n)
            if area > 0:
                break
            r, c = signed(path[first, 0]), signed(path[first, 1])
        w0, w1 = c0 >> 6, ((c1 - 1) >> 6) + 1
        size = (r1 - r0) * (w1 - w0)
        if n_words + size > len(words):
            more_words = np.empty(max(n_words + size, 2 * n_words), np.uint64)
            put(more_words, 0, words[:n_words])
            words = more_words
        words[n_words : n_words + size] = NONE
        content = words[n_words : n_words + size].reshape(r1 - r0, w1 - w0)
        n_cells = fill(path, edges, n, r0, w0, content)
        if n < least:
            open_cells = content & safe[r0:r1, w0:w1]
            content = component(open_cells, path[first, 0] - r0, path[first, 1] - 64 * w0)
        spread[0], spread[1] = min(spread[0], r0), max(spread[1], r1)
        spread[2], spread[3] = min(spread[2], w0), max(spread[3], w1)
        _mark_taken(taken, content, r0, w0)
        if n >= least:
            start = _first_step(path, edges, n, first)
            if count == len(table):
                table = doubled(table)
            entry = table[count]
            entry[ROW0], entry[ROW1], entry[COL0], entry[COL1] = r0, r1, c0, c1
            entry[N_CELLS], entry[N_BOUNDARY] = n_cells, n
            entry[BOUNDARY_AT], entry[CONTENT_AT] = n_boundary, n_words
            count += 1
            if n_boundary + n > len(boundary):
                more = np.empty((max(n_boundary + n, 2 * n_boundary), 2), np.int32)
                put_rows(more, 0, boundary[:n_boundary])
                boundary = more
            flat = boundary.ravel()
            put(flat, 2 * n_boundary, path[start:n].ravel())
            put(flat, 2 * (n_boundary + n - start), path[:start].ravel())
            n_boundary += n
            n_words += size
        row, w = _next_seed(seeds, taken, row, w, row1, word0, word1)
    return table[:count].copy(), boundary[:n_boundary], words[:n_words], spread
