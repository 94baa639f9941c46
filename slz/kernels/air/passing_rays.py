"""Rays through columns in which something stood: those that it returned, and those that passed."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D, ReadOnly2D, Strided2D
from slz.kernels.jit import kernel, kernel_part

# Fields of a column's record: lowest and highest return (m); number of rays it returned, of those that passed
# between the first and the last one that it or a column around returned, and of those since; the same of
# scans, of it and of the columns around; unit vector and length (m) of the rays returned.
BASE, TOP, RETURNED, BEFORE, SINCE, SCANS_RETURNED, SCANS_BEFORE, SCANS_SINCE = range(8)
EAST, NORTH, UP, RANGE = range(8, 12)
FIELDS = 12
PAD = 0.1  # m over the top and below the base, in which a return is of what stands there
THIN = 0.02  # the same, in which a ray counts as passing through it
SAME_SIDE = np.cos(np.radians(20.0))  # between a ray and those that were returned, of rays that are alike
PASSED, HIT = np.uint8(1), np.uint8(2)  # how a scan saw a column
BLOCK = 16  # columns along the side of a block, which a ray crosses in one step where it has no record
FARTHER = 1.25  # of the range of those that were returned, beyond which a ray may miss what is thin


@kernel
def _mark(
    index: Array2D[np.int32],
    r: int,
    c: int,
    around: int,
    look: np.uint8,
    looks: Array1D[np.uint8],
    records: Array2D[np.float64],
) -> None:
    """Note how a scan saw the columns around a ray.

    Rays that passed before the first return do not count: perhaps nothing stood there yet. Rays that passed
    before another one were not returned by what stands there.
    """
    for i in range(max(0, r - around), min(index.shape[0], r + around + 1)):
        for j in range(max(0, c - around), min(index.shape[1], c + around + 1)):
            k = index[i, j]
            if k >= 0:
                if look == HIT:
                    if records[k, SCANS_RETURNED] > 0.0 or looks[k] == HIT:
                        records[k, BEFORE] += records[k, SINCE]
                    else:
                        records[k, SCANS_SINCE] = 0.0
                    records[k, SINCE] = 0.0
                looks[k] = max(looks[k], look)


@kernel_part
def _end_scan(looks: Array1D[np.uint8], records: Array2D[np.float64]) -> None:
    """Count a scan for each column that it passed, or of whose object it returned rays."""
    for k in range(len(records)):
        if looks[k] >= HIT:
            records[k, SCANS_RETURNED] += 1.0
            records[k, SCANS_BEFORE] += records[k, SCANS_SINCE]
            records[k, SCANS_SINCE] = 0.0
        elif looks[k] == PASSED:
            records[k, SCANS_SINCE] += 1.0
        looks[k] = 0


@kernel
def _blocks(index: Array2D[np.int32]) -> Array2D[np.bool_]:
    """Return which blocks of columns have a record."""
    rows, cols = index.shape
    out = np.zeros(((rows - 1) // BLOCK + 1, (cols - 1) // BLOCK + 1), np.bool_)
    for r in range(rows):
        for c in range(cols):
            if index[r, c] >= 0:
                out[r // BLOCK, c // BLOCK] = True
    return out


@kernel
def count_passing(
    points: ReadOnly2D[np.float64],
    origin: ReadOnly1D[np.uint16],
    origins: ReadOnly2D[np.float64],
    raised: ReadOnly1D[np.bool_],
    stride: int,
    west: float,
    south: float,
    cell: float,
    around: int,
    index: Array2D[np.int32],
    records: Array2D[np.float64],
) -> None:
    """Count the rays of a window, in their order, that columns returned and that passed them.

    Parameters
    ----------
    points, origin, origins
        (n, 3) returns, (n,) the scan of each, and (k, 3) the sensor's position in each scan.
    raised
        (n,) the returns of what stands in the columns; their columns have records.
    stride
        One in `stride` of the other returns is followed, and stands for all.
    west, south, cell
        Corner of the first column, and the columns' width (m).
    around
        Columns to each side of a return, in which something of the same object may stand.
    index
        (rows, cols) record of each column, -1 for none.
    records
        (m, FIELDS), changed.
    """
    rows, cols = index.shape
    lowest, highest = records[:, BASE].min() - THIN, records[:, TOP].max() + THIN
    looks, blocks = np.zeros(len(records), np.uint8), _blocks(index)
    for i in range(len(points)):
        if i > 0 and origin[i] != origin[i - 1]:
            _end_scan(looks, records)
        own_r = int(np.floor((points[i, 1] - south) / cell))
        own_c = int(np.floor((points[i, 0] - west) / cell))
        inside = 0 <= own_r < rows and 0 <= own_c < cols
        own = index[own_r, own_c] if inside else np.int32(-1)
        hit = own >= 0 and (raised[i] or records[own, BASE] - PAD <= points[i, 2] <= records[own, TOP] + PAD)
        if hit:
            records[own, RETURNED] += 1.0
            _mark(index, own_r, own_c, around, HIT, looks, records)
        elif i % stride:
            continue
        o = origins[origin[i]]
        x, y, z = points[i, 0] - o[0], points[i, 1] - o[1], points[i, 2] - o[2]
        length = np.sqrt(x * x + y * y + z * z)
        if not length > 0.0:  # NaN too
            continue
        # The part of the ray between the heights of all records, and over the box of all columns.
        begin, end = 0.0, 1.0
        for axis in range(3):
            step = points[i, axis] - o[axis]
            low = (west, south, lowest)[axis]
            high = (west + cols * cell, south + rows * cell, highest)[axis]
            if step == 0.0:
                if not low <= o[axis] <= high:
                    end = -1.0
                continue
            one, other = (low - o[axis]) / step, (high - o[axis]) / step
            begin, end = max(begin, min(one, other)), min(end, max(one, other))
        if not begin < end:
            continue
        r = min(rows - 1, max(0, int(np.floor((o[1] + begin * y - south) / cell))))
        c = min(cols - 1, max(0, int(np.floor((o[0] + begin * x - west) / cell))))
        north, east = (1 if y > 0 else -1), (1 if x > 0 else -1)
        share = begin
        while share < end and 0 <= r < rows and 0 <= c < cols:
            wide = 1 if blocks[r // BLOCK, c // BLOCK] else BLOCK
            first_r, first_c = r // wide * wide, c // wide * wide
            next_r = (south + (first_r + (wide if y > 0 else 0)) * cell - o[1]) / y if y != 0.0 else np.inf
            next_c = (west + (first_c + (wide if x > 0 else 0)) * cell - o[0]) / x if x != 0.0 else np.inf
            leave = min(next_r, next_c, end)
            k = index[r, c]
            if k >= 0 and not (hit and k == own):
                low, high = o[2] + share * z, o[2] + leave * z
                low, high = min(low, high), max(low, high)
                held = records[k]
                alike = (x * held[EAST] + y * held[NORTH] + z * held[UP]) >= SAME_SIDE * length
                near = share * length <= FARTHER * held[RANGE]
                if alike and near and low <= held[TOP] + THIN and high >= held[BASE] - THIN:
                    held[SINCE] += 1.0 if hit else float(stride)
                    if looks[k] == 0:
                        _mark(index, r, c, around, PASSED, looks, records)
            share = leave
            if wide > 1:  # to where the ray leaves the block
                r = min(first_r + wide - 1, max(first_r, int(np.floor((o[1] + share * y - south) / cell))))
                c = min(first_c + wide - 1, max(first_c, int(np.floor((o[0] + share * x - west) / cell))))
            if next_r <= next_c:
                r = first_r + wide if north > 0 else first_r - 1
            else:
                c = first_c + wide if east > 0 else first_c - 1
    _end_scan(looks, records)


@kernel
def sums_around(
    index: Array2D[np.int32], cells: Strided2D[np.int64], around: int, records: Array2D[np.float64]
) -> Array2D[np.float64]:
    """Return (m, 3) returned, passed before and passed since, of each record's column and those around."""
    out = np.zeros((len(cells), 3))
    for k in range(len(cells)):
        r, c = cells[k, 0], cells[k, 1]
        for i in range(max(0, r - around), min(index.shape[0], r + around + 1)):
            for j in range(max(0, c - around), min(index.shape[1], c + around + 1)):
                other = index[i, j]
                if other >= 0:
                    out[k, 0] += records[other, RETURNED]
                    out[k, 1] += records[other, BEFORE]
                    out[k, 2] += records[other, SINCE]
    return out


@kernel
def are_beside(
    points: ReadOnly2D[np.float64],
    west: float,
    south: float,
    cell: float,
    around: int,
    upward: float,
    index: Array2D[np.int32],
    records: Array2D[np.float64],
) -> Array1D[np.bool_]:
    """Return (n,) which points are over a column with a record, or over one of those around such a column.

    They are no more than `upward` (m) over the top of a record there.
    """
    rows, cols = index.shape
    high = np.full((rows, cols), -np.inf)
    out = np.zeros(len(points), np.bool_)
    for r in range(rows):
        for c in range(cols):
            k = index[r, c]
            if k >= 0:
                for i in range(max(0, r - around), min(rows, r + around + 1)):
                    for j in range(max(0, c - around), min(cols, c + around + 1)):
                        high[i, j] = max(high[i, j], records[k, TOP] + upward)
    for i in range(len(points)):
        r = int(np.floor((points[i, 1] - south) / cell))
        c = int(np.floor((points[i, 0] - west) / cell))
        if 0 <= r < rows and 0 <= c < cols:
            out[i] = points[i, 2] <= high[r, c]
    return out
