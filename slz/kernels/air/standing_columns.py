"""Columns in which something stands: returns that are of it, and what a window changed."""

from __future__ import annotations

import numpy as np

from slz.kernels.air.passing_rays import (
    BASE,
    BASE_EAST,
    CAME,
    COL,
    COLUMN_FIELDS,
    EAST,
    FARTHER,
    GONE,
    NORTH,
    RANGE,
    RETURNED,
    ROW,
    SAME_SIDE,
    SCANS_SINCE,
    TOP,
    TOP_EAST,
    UP,
)
from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D, ReadOnly2D
from slz.kernels.array_memory import put
from slz.kernels.jit import kernel, kernel_part

NEW = -2  # in an index of columns, where the first return came


@kernel_part
def _cells_of(
    points: ReadOnly2D[np.float64], which: Array1D[np.int64], west: float, south: float, cell: float
) -> Array2D[np.int64]:
    """Return row and column of some of the points."""
    out = np.empty((len(which), 2), np.int64)
    for n in range(len(which)):
        out[n, 0] = int(np.floor((points[which[n], 1] - south) / cell))
        out[n, 1] = int(np.floor((points[which[n], 0] - west) / cell))
    return out


@kernel_part
def _with_returns(
    records: Array2D[np.float64],
    points: ReadOnly2D[np.float64],
    which: Array1D[np.int64],
    origin: ReadOnly1D[np.uint16],
    origins: ReadOnly2D[np.float64],
    west: float,
    south: float,
    cell: float,
    now_s: float,
) -> Array2D[np.float64]:
    """Return records by row and column, with those of further returns; what comes to a gone one is new."""
    if not len(which):
        return records
    at = _cells_of(points, which, west, south, cell)
    r0, r1, c0, c1 = at[0, 0], at[0, 0], at[0, 1], at[0, 1]
    for n in range(len(at)):
        r0, r1, c0, c1 = min(r0, at[n, 0]), max(r1, at[n, 0]), min(c0, at[n, 1]), max(c1, at[n, 1])
    for k in range(len(records)):
        r0, r1 = min(r0, int(records[k, ROW])), max(r1, int(records[k, ROW]))
        c0, c1 = min(c0, int(records[k, COL])), max(c1, int(records[k, COL]))
    index = np.full((r1 - r0 + 1, c1 - c0 + 1), -1, np.int64)
    for k in range(len(records)):
        index[int(records[k, ROW]) - r0, int(records[k, COL]) - c0] = k
    total = len(records)
    for n in range(len(which)):
        k = index[at[n, 0] - r0, at[n, 1] - c0]
        if k == -1:
            total += 1
        if k == -1 or (k >= 0 and records[k, GONE]):
            index[at[n, 0] - r0, at[n, 1] - c0] = NEW
    out, k = np.zeros((total, COLUMN_FIELDS)), 0
    for r in range(index.shape[0]):
        for c in range(index.shape[1]):
            if index[r, c] >= 0:
                put(out[k], 0, records[index[r, c]])
            elif index[r, c] == NEW:
                out[k, ROW], out[k, COL], out[k, CAME] = r0 + r, c0 + c, now_s
                out[k, TOP], out[k, BASE] = -np.inf, np.inf
            else:
                continue
            index[r, c] = k
            k += 1
    own = np.empty(len(which), np.int64)
    for n in range(len(which)):
        own[n] = index[at[n, 0] - r0, at[n, 1] - c0]
    _add_returns(out, own, points, which, origin, origins)
    return out


@kernel_part
def _add_returns(
    records: Array2D[np.float64],
    own: Array1D[np.int64],
    points: ReadOnly2D[np.float64],
    which: Array1D[np.int64],
    origin: ReadOnly1D[np.uint16],
    origins: ReadOnly2D[np.float64],
) -> None:
    """Add returns to their records: ends, direction and range."""
    count, ways = np.zeros(len(records), np.int64), np.zeros((len(records), 4))
    lowest, highest = np.zeros((2, len(records)), np.int64)
    for n in range(len(which)):
        i, k = which[n], own[n]
        o = origins[origin[i]]
        x, y, z = points[i, 0] - o[0], points[i, 1] - o[1], points[i, 2] - o[2]
        length = np.sqrt(x * x + y * y + z * z)
        ways[k, 0] += x / length
        ways[k, 1] += y / length
        ways[k, 2] += z / length
        ways[k, 3] += length
        if count[k] == 0 or points[i, 2] < points[lowest[k], 2]:
            lowest[k] = i
        if count[k] == 0 or points[i, 2] >= points[highest[k], 2]:
            highest[k] = i
        count[k] += 1
    for k in range(len(records)):
        if count[k] == 0:
            continue
        record = records[k]
        x, y, z = ways[k, 0], ways[k, 1], ways[k, 2]
        length = np.sqrt(x * x + y * y + z * z)
        x, y, z, away = x / length, y / length, z / length, ways[k, 3] / count[k]
        alike = x * record[EAST] + y * record[NORTH] + z * record[UP] >= SAME_SIDE
        if not alike or away > FARTHER * record[RANGE] or record[RANGE] > FARTHER * away:
            # Seen from another side, or from farther, it may return another share of the rays.
            record[RETURNED : SCANS_SINCE + 1] = 0.0
        record[EAST], record[NORTH], record[UP], record[RANGE] = x, y, z, away
        if points[highest[k], 2] > record[TOP]:
            put(record, TOP_EAST, points[highest[k]])
        if points[lowest[k], 2] < record[BASE]:
            put(record, BASE_EAST, points[lowest[k]])


@kernel_part
def _tops_around(
    records: Array2D[np.float64], margin: int, around: int
) -> tuple[int, int, Array2D[np.float64]]:
    """Return the first row and column of a box around all columns, and the highest top near each in it.

    They are those of the columns that are not gone, up to `around` columns to each side, and minus infinity.
    """
    r0, c0 = int(records[:, ROW].min()) - margin, int(records[:, COL].min()) - margin
    rows, cols = int(records[:, ROW].max()) + 1 + margin - r0, int(records[:, COL].max()) + 1 + margin - c0
    out = np.full((rows, cols), -np.inf)
    for k in range(len(records)):
        if not records[k, GONE]:
            r, c = int(records[k, ROW]) - r0, int(records[k, COL]) - c0
            for i in range(r - around, r + around + 1):
                for j in range(c - around, c + around + 1):
                    out[i, j] = max(out[i, j], records[k, TOP])
    return r0, c0, out


@kernel_part
def _in_or_beside(
    records: Array2D[np.float64],
    points: ReadOnly2D[np.float64],
    rows: ReadOnly1D[np.int64],
    raised: Array1D[np.bool_],
    isolated: ReadOnly1D[np.bool_],
    around: int,
    same_m: float,
    west: float,
    south: float,
    cell: float,
) -> tuple[Array1D[np.int64], Array1D[np.int64]]:
    """Return the rows of what is in the columns or next to them, and of what is farther, but beside them."""
    own, n_own, beside, n_beside = np.empty(len(rows), np.int64), 0, np.empty(len(rows), np.int64), 0
    if not len(records):
        return own[:0], beside[:0]
    r0, c0, tops = _tops_around(records, around, around)
    below = _tops_around(records, around, 1)[2]
    west0, south0 = west + c0 * cell, south + r0 * cell
    for i in rows:
        r, c = int(np.floor((points[i, 1] - south0) / cell)), int(np.floor((points[i, 0] - west0) / cell))
        if not (0 <= r < tops.shape[0] and 0 <= c < tops.shape[1]) or tops[r, c] == -np.inf:
            continue
        if raised[i] or (below[r, c] > -np.inf and not isolated[i]):
            own[n_own] = i
            n_own += 1
        elif points[i, 2] <= tops[r, c] + same_m:
            beside[n_beside] = i
            n_beside += 1
    return own[:n_own], beside[:n_beside]


@kernel
def join(
    records: Array2D[np.float64],
    points: ReadOnly2D[np.float64],
    rows: ReadOnly1D[np.int64],
    raised: Array1D[np.bool_],
    isolated: ReadOnly1D[np.bool_],
    origin: ReadOnly1D[np.uint16],
    origins: ReadOnly2D[np.float64],
    here: ReadOnly1D[np.float64],
    reach: int,
    around: int,
    same_m: float,
    west: float,
    south: float,
    cell: float,
    now_s: float,
) -> tuple[Array2D[np.float64], Array1D[np.int64], Array1D[np.int64]]:
    """Add the raised returns of a window to the columns; isolated ones only where they are beside a column.

    The result are the records, the rows of what is in the columns and of what is below or next to it, and the
    rows of what is farther, but beside it.

    Parameters
    ----------
    records
        (m, COLUMN_FIELDS) columns, each up to `reach` rows and columns from `here`.
    points, rows
        (n, 3) returns, and which of them to take, in the order of their scans.
    raised, isolated
        (n,) which of them are higher than known ground, and which have few others around them. `raised` is
        cleared where the return is not added.
    origin, origins
        (n,) scan of each return, and (k, 3) the sensor's position in each scan.
    here
        Row and column of the sensor.
    around, same_m
        Columns to each side, and height over what stands there, up to which a return is beside a column.
    west, south, cell
        Corner from which rows and columns count, and their width (m).
    """
    up = rows[raised[rows]]
    at = _cells_of(points, up, west, south, cell)
    for k in range(len(up)):
        raised[up[k]] = abs(at[k, 0] - here[0]) <= reach and abs(at[k, 1] - here[1]) <= reach
    up = up[raised[up]]
    alone, several = up[isolated[up]], up[np.logical_not(isolated[up])]
    records = _with_returns(records, points, several, origin, origins, west, south, cell, now_s)
    raised[alone] = False
    if len(records) and len(alone):
        r0, c0, tops = _tops_around(records, around, around)
        at = _cells_of(points, alone, west + c0 * cell, south + r0 * cell, cell)
        for k in range(len(alone)):
            if 0 <= at[k, 0] < tops.shape[0] and 0 <= at[k, 1] < tops.shape[1]:
                raised[alone[k]] = points[alone[k], 2] <= tops[at[k, 0], at[k, 1]] + same_m
        alone = alone[raised[alone]]
        records = _with_returns(records, points, alone, origin, origins, west, south, cell, now_s)
    return records, *_in_or_beside(records, points, rows, raised, isolated, around, same_m, west, south, cell)


@kernel
def stand_around(records: Array2D[np.float64], around: int) -> Array1D[np.bool_]:
    """Return which columns are not gone, or one around them is not."""
    r0, c0, tops = _tops_around(records, around, around)
    out = np.empty(len(records), np.bool_)
    for k in range(len(records)):
        out[k] = tops[int(records[k, ROW]) - r0, int(records[k, COL]) - c0] > -np.inf
    return out
