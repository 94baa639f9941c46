"""Connected components of a bitmap by run-length encoding and union-find."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.array_memory import doubled
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.raster.bitmap import NONE, Bits, lowest, word_mask


@kernel_part
def runs(cells: Bits) -> Array2D[np.int64]:
    """Return (n, 4) row, first column, column after the last, and number of all runs, row by row."""
    out, n = np.empty((1024, 4), np.int64), 0
    for r in range(cells.shape[0]):
        for w in range(cells.shape[1]):
            word = cells[r, w]
            while word != NONE:
                first = np.int64(lowest(word))
                rest = ~(word >> np.uint64(first))
                length = np.int64(lowest(rest)) if rest != NONE else 64
                start = 64 * w + first
                if n and out[n - 1, 0] == r and out[n - 1, 2] == start:
                    out[n - 1, 2] = start + length
                else:
                    if n == len(out):
                        out = doubled(out)
                    out[n, 0], out[n, 1], out[n, 2], out[n, 3] = r, start, start + length, n
                    n += 1
                if first + length >= 64:
                    break
                word = (word >> np.uint64(first + length)) << np.uint64(first + length)
    return out[:n].copy()


@kernel_part
def _find_root(run: Array2D[np.int64], i: int) -> int:
    while run[i, 3] != i:
        run[i, 3] = run[run[i, 3], 3]
        i = run[i, 3]
    return i


@kernel_part
def union_runs(run: Array2D[np.int64], corner: int) -> None:
    """Label the runs of each component with the number of its first run; `corner` is 1 for 8-connectivity."""
    n, above = len(run), 0
    for i in range(n):
        while above < i and (run[above, 0] < run[i, 0] - 1 or (
            run[above, 0] == run[i, 0] - 1 and run[above, 2] < run[i, 1] + 1 - corner
        )):  # fmt: skip
            above += 1
        k = above
        while k < i and run[k, 0] == run[i, 0] - 1 and run[k, 1] < run[i, 2] + corner:
            a, b = _find_root(run, k), _find_root(run, i)
            run[max(a, b), 3] = min(a, b)
            k += 1
    for i in range(n):
        run[i, 3] = _find_root(run, i)


@kernel_part
def _largest(roots: Array1D[np.int64], size: Array1D[np.int64], most: int) -> Array1D[np.int64]:
    """Return the `most` roots of the greatest size, in order; of equal sizes the first."""
    least = more = 0
    for i in range(len(roots)):
        least = max(least, size[roots[i]])
    of_size = np.zeros(least + 1, np.int64)
    for i in range(len(roots)):
        of_size[size[roots[i]]] += 1
    while more + of_size[least] < most:
        more += of_size[least]
        least -= 1
    equal, out, n = most - more, np.empty(most, np.int64), 0
    for i in range(len(roots)):
        if size[roots[i]] > least or (size[roots[i]] == least and equal > 0):
            equal -= size[roots[i]] == least
            out[n] = roots[i]
            n += 1
    return out


@kernel
def largest_groups(cells: Bits, most: int) -> tuple[Array2D[np.int64], Array2D[np.int32]]:
    """Return the `most` largest components, in the order of their first cells.

    Returns
    -------
    (n, 6) row0, row1, col0, col1, and start and stop in the second array: (m, 2) rows and columns, component
    by component, each in raster order.
    """
    run = runs(cells)
    union_runs(run, 1)
    size = np.zeros(len(run), np.int64)
    for i in range(len(run)):
        size[run[i, 3]] += run[i, 2] - run[i, 1]
    roots = np.flatnonzero(size)
    if len(roots) > most:
        roots = _largest(roots, size, most)
    place, total = np.full(len(run), -1, np.int64), 0
    groups = np.empty((len(roots), 6), np.int64)
    for g in range(len(roots)):
        place[roots[g]] = g
        groups[g, 0], groups[g, 1], groups[g, 2], groups[g, 3] = cells.shape[0], 0, 64 * cells.shape[1], 0
        groups[g, 4] = groups[g, 5] = total
        total += size[roots[g]]
    out = np.empty((total, 2), np.int32)
    for i in range(len(run)):
        g = place[run[i, 3]]
        if g < 0:
            continue
        group, r, a, b = groups[g], run[i, 0], run[i, 1], run[i, 2]
        group[0], group[1] = min(group[0], r), max(group[1], r + 1)
        group[2], group[3] = min(group[2], a), max(group[3], b)
        for c in range(a, b):
            out[group[5], 0], out[group[5], 1] = r, c
            group[5] += 1
    return groups, out


@kernel_part
def _any_of(cells: Bits, row: int, first: int, stop: int) -> bool:
    """Return whether any cell of a run is set."""
    for w in range(first >> 6, ((stop - 1) >> 6) + 1):
        if cells[row, w] & word_mask(first - 64 * w, stop - 64 * w) != NONE:
            return True
    return False


@kernel
def components(cells: Bits, corners: Bits) -> tuple[Array2D[np.int64], Array2D[np.int64]]:
    """Return the components that hold a corner, in the order of the first corner's run.

    Parameters
    ----------
    corners
        Subset of the cells; a component must hold one of them.

    Returns
    -------
    (m, 4) runs, component by component; (n, 6) row0, row1, col0, col1, and start and stop in the runs.
    """
    run = runs(cells)
    union_runs(run, 1)
    size, place, n = np.zeros(len(run), np.int64), np.full(len(run), -1, np.int64), 0
    for i in range(len(run)):
        root = run[i, 3]
        size[root] += 1
        if place[root] < 0 and _any_of(corners, run[i, 0], run[i, 1], run[i, 2]):
            place[root] = n
            n += 1
    groups, total = np.empty((n, 6), np.int64), 0
    for i in range(len(run)):
        if place[i] >= 0:
            groups[place[i], 5] = size[i]
    for g in range(n):
        groups[g, 0], groups[g, 1], groups[g, 2], groups[g, 3] = cells.shape[0], 0, 64 * cells.shape[1], 0
        groups[g, 4], total = total, total + groups[g, 5]
        groups[g, 5] = groups[g, 4]
    out = np.empty((total, 4), np.int64)
    for i in range(len(run)):
        g = place[run[i, 3]]
        if g >= 0:
            k, r, first, stop = groups[g, 5], run[i, 0], run[i, 1], run[i, 2]
            groups[g, 0], groups[g, 1] = min(groups[g, 0], r), max(groups[g, 1], r + 1)
            groups[g, 2], groups[g, 3] = min(groups[g, 2], first), max(groups[g, 3], stop)
            out[k, 0], out[k, 1], out[k, 2], out[k, 3] = r, first, stop, k - groups[g, 4]
            groups[g, 5] = k + 1
    return out, groups


@kernel
def put_without_small_parts(run: Array2D[np.int64], fewest: int, out: Bits) -> None:
    """Set the cells of runs, except small parts that touch the rest at a corner only.

    The largest part is kept, however small. Other parts of fewer than `fewest` cells are left out.

    Parameters
    ----------
    run
        Runs of one component of `components`.
    out
        Rows of the runs, from the word of their first column on; zeros.
    """
    row0, word0 = run[0, 0], run[:, 1].min() >> 6
    run = run.copy()
    for i in range(len(run)):
        run[i, 3] = i
    union_runs(run, 0)
    size = np.zeros(len(run), np.int64)
    for i in range(len(run)):
        size[run[i, 3]] += run[i, 2] - run[i, 1]
    least = min(fewest, np.int64(size.max()))
    for i in range(len(run)):
        r, first, stop = run[i, 0] - row0, run[i, 1], run[i, 2]
        if size[run[i, 3]] >= least:
            for w in range(first >> 6, ((stop - 1) >> 6) + 1):
                out[r, w - word0] |= word_mask(first - 64 * w, stop - 64 * w)


@kernel
def highest_cells(tops: Array1D[np.float32], groups: Array2D[np.int64]) -> Array1D[np.int64]:
    """Return the index of each group's highest cell, the first of equals; its first cell where unknown."""
    out = np.empty(len(groups), np.int64)
    for g in range(len(groups)):
        out[g], top = groups[g, 4], np.float32(-np.inf)
        for i in range(groups[g, 4], groups[g, 5]):
            if tops[i] > top:
                out[g], top = i, tops[i]
    return out
