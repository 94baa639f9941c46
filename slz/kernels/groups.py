"""Groups of touching cells of a bit map, from runs along rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.bits import NONE, Bits, bit, lowest
from slz.kernels.jit import kernel
from slz.kernels.rows import doubled

Ints = NDArray[np.int64]


@kernel("int64[:, ::1](uint64[:, ::1])")
def runs(cells: Bits) -> Ints:
    """Return (n, 4) row, first column, column after the last and number, of all runs, row by row."""
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


@kernel("int64(int64[:, ::1], int64)")
def _root(run: Ints, i: int) -> int:
    while run[i, 3] != i:
        run[i, 3] = run[run[i, 3], 3]
        i = run[i, 3]
    return i


@kernel("void(int64[:, ::1], int64)")
def join(run: Ints, corner: int) -> None:
    """Give all runs of a group of touching cells the number of the first one; with 1, corners touch too."""
    n, above = len(run), 0
    for i in range(n):
        while above < i and (run[above, 0] < run[i, 0] - 1 or (
            run[above, 0] == run[i, 0] - 1 and run[above, 2] < run[i, 1] + 1 - corner
        )):  # fmt: skip
            above += 1
        k = above
        while k < i and run[k, 0] == run[i, 0] - 1 and run[k, 1] < run[i, 2] + corner:
            a, b = _root(run, k), _root(run, i)
            run[max(a, b), 3] = min(a, b)
            k += 1
    for i in range(n):
        run[i, 3] = _root(run, i)


@kernel("Tuple((int64[:, ::1], int32[:, ::1]))(uint64[:, ::1], int64)")
def largest_groups(cells: Bits, most: int) -> tuple[Ints, NDArray[np.int32]]:
    """Return the largest groups of touching cells, in the order of their first cells.

    Returns
    -------
    (n, 6) row0, row1, col0, col1, first and stop in the second: (m, 2) rows and columns, group by group, each
    in the order of rows and columns.
    """
    run = runs(cells)
    join(run, 1)
    size = np.zeros(len(run), np.int64)
    for i in range(len(run)):
        size[run[i, 3]] += run[i, 2] - run[i, 1]
    roots = np.flatnonzero(size)
    if len(roots) > most:
        roots = np.sort(roots[np.argsort(-size[roots], kind="mergesort")[:most]])
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


@kernel("Tuple((int64[:, ::1], int64[:, ::1]))(uint64[:, ::1], int32[:, :], int64)")
def components(cells: Bits, side: NDArray[np.int32], least: int) -> tuple[Ints, Ints]:
    """Return the groups of touching cells that hold a square of `least` cells, by the place of the first one.

    Parameters
    ----------
    side
        (rows, cols) of `contour.squares`.

    Returns
    -------
    (m, 4) the runs of one group after another; (n, 6) row0, row1, col0, col1 of each, where its runs begin
    and stop.
    """
    run = runs(cells)
    join(run, 1)
    size, place, n = np.zeros(len(run), np.int64), np.full(len(run), -1, np.int64), 0
    for i in range(len(run)):
        r, root = run[i, 0], run[i, 3]
        size[root] += 1
        if place[root] < 0:
            for c in range(run[i, 1], run[i, 2]):
                if side[r, c] >= least:
                    place[root] = n
                    n += 1
                    break
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


@kernel("Tuple((uint8[:, ::1], int64))(int64[:, ::1], int32[:, :], int64)")
def without_crumbs(run: Ints, side: NDArray[np.int32], fewest: int) -> tuple[NDArray[np.uint8], int]:
    """Return 1 for the cells of runs but what touches the rest at a corner only and is of fewer cells.

    The largest part stays, however small it is.

    Parameters
    ----------
    run
        Of one group of `components`.
    side
        (rows, cols) of `contour.squares`, of all cells.

    Returns
    -------
    Cells of the box of the runs; the side of the largest square of theirs.
    """
    row0, col0, col1 = run[0, 0], run[:, 1].min(), run[:, 2].max()
    run = run.copy()
    for i in range(len(run)):
        run[i, 3] = i
    join(run, 0)
    size = np.zeros(len(run), np.int64)
    for i in range(len(run)):
        size[run[i, 3]] += run[i, 2] - run[i, 1]
    least, largest = min(fewest, np.int64(size.max())), np.int64(0)
    out = np.zeros((run[-1, 0] + 1 - row0, col1 - col0), np.uint8)
    for i in range(len(run)):
        r, first, stop = run[i, 0], run[i, 1], run[i, 2]
        if size[run[i, 3]] >= least:
            for c in range(first, stop):
                out[r - row0, c - col0] = 1
                largest = max(largest, np.int64(side[r, c]))
    return out, int(largest)


@kernel("float64(uint64[:, ::1], float32[:, ::1], int64, int64, int64, int64)")
def middle_height(
    part: Bits, height: NDArray[np.float32], row0: int, row1: int, col0: int, col1: int
) -> float:
    """Return the median height of the cells of a part in a box, which may reach beyond; NaN of none."""
    row0, row1, col0, col1 = (
        max(0, row0),
        min(part.shape[0], row1),
        max(0, col0),
        min(64 * part.shape[1], col1),
    )
    found, n = np.empty(max(0, (row1 - row0) * (col1 - col0)), np.float32), 0
    for r in range(row0, row1):
        for c in range(col0, col1):
            if bit(part, r, c):
                found[n] = height[r, c]
                n += 1
    return np.float64(np.float32(np.median(found[:n]))) if n else np.nan


@kernel(
    "Tuple((float64[:, ::1], int64[:, ::1], float64[:, ::1]))(uint64[:, ::1], uint64[:, ::1],"
    " float32[:, ::1], float64, float64, float64, int64, int64)"
)
def obstacles(
    cells: Bits,
    part: Bits,
    height: NDArray[np.float32],
    west: float,
    south: float,
    cell: float,
    most: int,
    around: int,
) -> tuple[NDArray[np.float64], Ints, NDArray[np.float64]]:
    """Return the largest groups of cells with their highest cells and the ground about them.

    Returns
    -------
    (n, 4) east, north, height of the highest cell and height over the ground; (n, 2) first and stop in the
    last: (m, 2) east and north of the centres of the cells, group by group.
    """
    groups, listed = largest_groups(cells, most)
    n, centres = len(groups), np.empty((len(listed), 2))
    for i in range(len(listed)):
        centres[i, 0] = west + (listed[i, 1] + 0.5) * cell
        centres[i, 1] = south + (listed[i, 0] + 0.5) * cell
    out, ends = np.empty((n, 4)), np.empty((n, 2), np.int64)
    for g in range(n):
        first, stop = groups[g, 4], groups[g, 5]
        top, best = -np.inf, first
        for i in range(first, stop):
            z = height[listed[i, 0], listed[i, 1]]
            if z > top:
                top, best = np.float64(z), i
        ground = middle_height(
            part, height,
            groups[g, 0] - around, groups[g, 1] + around, groups[g, 2] - around, groups[g, 3] + around,
        )  # fmt: skip
        out[g, 0], out[g, 1], out[g, 2], out[g, 3] = centres[best, 0], centres[best, 1], top, top - ground
        ends[g, 0], ends[g, 1] = first, stop
    return out, ends, centres
