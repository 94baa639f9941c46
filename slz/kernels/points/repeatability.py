"""Repeatability of heights over square blocks of ground, and the points over some of them."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D, ReadOnly2D
from slz.kernels.jit import kernel


@kernel
def spread_of_blocks(
    found: Array2D[np.float64], west: float, south: float, side: float, rows: int, cols: int, fewest: int
) -> Array2D[np.float64]:
    """Return the standard deviation of the differences in each of rows x cols blocks, NaN where unknown.

    Its square is half the mean square of successive differences (J. von Neumann et al., Annals of
    Mathematical Statistics 12, 1941), which slow changes of the vehicle's height and attitude do not raise.

    Parameters
    ----------
    found
        (m, 4) of `slz.kernels.cells.accumulate.differences`, all over the blocks, in the order of the window.
    west, south, side
        Corner of the blocks, and the side of one (m).
    fewest
        Pairs of successive returns, below which a block is unknown.
    """
    spread, pairs, last = np.zeros((rows, cols)), np.full((rows, cols), -1), np.zeros((rows, cols))
    for k in range(len(found)):
        r, c = int((found[k, 1] - south) / side), int((found[k, 0] - west) / side)
        pairs[r, c] += 1
        if pairs[r, c] > 0:
            spread[r, c] += (found[k, 2] - last[r, c]) ** 2
        last[r, c] = found[k, 2]
    for r in range(rows):
        for c in range(cols):
            n = pairs[r, c]
            spread[r, c] = np.sqrt(spread[r, c] / (2 * n)) if n >= fewest else np.nan
    return spread


@kernel
def over_blocks(
    points: ReadOnly2D[np.float64],
    which: Array1D[np.int64],
    west: float,
    south: float,
    side: float,
    blocks: Array2D[np.bool_],
) -> Array1D[np.bool_]:
    """Return which of some points, (m,) indices `which` of (n, 3), are over blocks that are set."""
    out, (rows, cols) = np.empty(len(which), np.bool_), blocks.shape
    for k in range(len(which)):
        r = int(np.floor((points[which[k], 1] - south) / side))
        c = int(np.floor((points[which[k], 0] - west) / side))
        out[k] = 0 <= r < rows and 0 <= c < cols and blocks[r, c]
    return out


@kernel
def bounds(found: Array2D[np.float64]) -> tuple[float, float, float, float]:
    """Return the least east and north of (m, 4) places, m > 0, and how far they extend."""
    west = east = found[0, 0]
    south = north = found[0, 1]
    for k in range(len(found)):
        west, east = min(west, found[k, 0]), max(east, found[k, 0])
        south, north = min(south, found[k, 1]), max(north, found[k, 1])
    return west, south, east - west, north - south


@kernel
def rows_by_span(
    points: ReadOnly2D[np.float64],
    used: Array1D[np.int64],
    scan: ReadOnly1D[np.uint16],
    of_scan: Array1D[np.int64],
    n: int,
    most: int,
    west: float,
    south: float,
    side: float,
    blocks: Array2D[np.bool_],
) -> tuple[Array1D[np.int64], Array1D[np.int64], Array2D[np.int64]]:
    """Return rows of points that are over blocks, span by span, every so-manieth of a span; and their spans.

    Parameters
    ----------
    points, used, scan
        (n, 3), (m,) rows to choose from, and (n,) the scan of each point.
    of_scan, n, most
        Span of each scan, number of spans, and number of rows of a span from twice which on some are left
        out.

    Returns
    -------
    The third is (2, n): numbers of used rows of each span, and of those over blocks.
    """
    on, count = over_blocks(points, used, west, south, side, blocks), np.zeros((2, n), np.int64)
    for k in range(len(used)):
        span = of_scan[scan[used[k]]]
        count[0, span] += 1
        count[1, span] += on[k]
    step, place, seen = np.maximum(1, count[1] // most), np.zeros(n + 1, np.int64), np.zeros(n, np.int64)
    for span in range(n):
        place[span + 1] = place[span] + (count[1, span] + step[span] - 1) // step[span]
    rows, spans = np.empty(place[n], np.int64), np.empty(place[n], np.int64)
    for k in range(len(used)):
        span = of_scan[scan[used[k]]]
        if on[k]:
            if seen[span] % step[span] == 0:
                to = place[span] + seen[span] // step[span]
                rows[to], spans[to] = used[k], span
            seen[span] += 1
    return rows, spans, count
