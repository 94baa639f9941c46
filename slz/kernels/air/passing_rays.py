"""Rays through columns in which something stood: those that it returned, and those that passed."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D, ReadOnly2D
from slz.kernels.array_memory import put
from slz.kernels.jit import kernel, kernel_part

# ROW, COL: of the column, from the evidence's corner. CAME: when the first return came (s). GONE: proven
# empty; such a one counts as long as others around are not. TOP_EAST, TOP_NORTH, TOP and BASE_EAST,
# BASE_NORTH, BASE: highest and lowest return. RETURNED, BEFORE, SINCE: number of rays it returned, of those
# that passed between the first and the last one that it or a column around returned, and of those since.
# SCANS_RETURNED, SCANS_BEFORE, SCANS_SINCE: the same of scans, of it and of the columns around. EAST, NORTH,
# UP, RANGE: unit vector and length of the rays returned.
(
    ROW, COL, CAME, GONE, TOP_EAST, TOP_NORTH, TOP, BASE_EAST, BASE_NORTH, BASE,
    RETURNED, BEFORE, SINCE, SCANS_RETURNED, SCANS_BEFORE, SCANS_SINCE, EAST, NORTH, UP, RANGE,
) = range(20)  # fmt: skip
COLUMN_FIELDS = 20

SAME_SIDE = np.cos(np.radians(20.0))  # between a ray and those that were returned, of rays that are alike
FARTHER = 1.25  # of the range of those that were returned, beyond which a ray may miss what is thin


PAD = 0.1  # m over the top and below the base, in which a return is of what stands there
THIN = 0.02  # m over the top and below the base, in which a ray counts as passing through it
BLOCK_BITS, BLOCK = 4, 16  # columns along a block's side; a ray crosses a block without records in one step
PASSED, HIT = np.uint8(1), np.uint8(2)  # how a scan saw a column
OWN = 2.0  # rays that passed a column itself, of one that may be proven empty


@kernel
def index_of(
    records: Array2D[np.float64], margin: int
) -> tuple[int, int, Array2D[np.int32], Array2D[np.bool_]]:
    """Return the first row and column of a box around all columns, the record of each in it, and its blocks.

    The record is -1 for none. Blocks of `BLOCK` x `BLOCK` columns record whether one of these has a record.
    """
    r0, c0 = int(records[:, ROW].min()) - margin, int(records[:, COL].min()) - margin
    rows, cols = int(records[:, ROW].max()) + 1 + margin - r0, int(records[:, COL].max()) + 1 + margin - c0
    index = np.full((rows, cols), -1, np.int32)
    blocks = np.zeros((((rows - 1) >> BLOCK_BITS) + 1, ((cols - 1) >> BLOCK_BITS) + 1), np.bool_)
    for k in range(len(records)):
        r, c = int(records[k, ROW]) - r0, int(records[k, COL]) - c0
        index[r, c], blocks[r >> BLOCK_BITS, c >> BLOCK_BITS] = k, True
    return r0, c0, index, blocks


@kernel_part
def _note_look(
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


@kernel_part
def _clip(
    origin: float, step: float, low: float, high: float, begin: float, end: float
) -> tuple[float, float]:
    """Return the part of a ray, from `begin` to `end` of its length, that is between two planes."""
    if step == 0.0:
        return begin, (end if low <= origin <= high else -1.0)
    one, other = (low - origin) / step, (high - origin) / step
    return max(begin, min(one, other)), min(end, max(one, other))


@kernel
def count_passing(
    points: ReadOnly2D[np.float64],
    taken: ReadOnly1D[np.int64],
    origin: ReadOnly1D[np.uint16],
    origins: ReadOnly2D[np.float64],
    raised: ReadOnly1D[np.bool_],
    stride: int,
    west: float,
    south: float,
    cell: float,
    around: int,
    index: Array2D[np.int32],
    blocks: Array2D[np.bool_],
    records: Array2D[np.float64],
) -> None:
    """Count the rays of a window, in their order, that columns returned and that passed them.

    Parameters
    ----------
    points, taken, origin, origins
        (n, 3) returns, which of them to count, in the order of their scans, (n,) the scan of each, and (k, 3)
        the sensor's position in each scan.
    raised
        (n,) the returns of what stands in the columns; their columns have records.
    stride
        One in `stride` of the other returns is followed, and stands for all.
    west, south, cell
        Corner of the first column, and the columns' width (m).
    around
        Columns to each side of a return, in which something of the same object may stand.
    index, blocks
        Of `index_of`.
    records
        (m, COLUMN_FIELDS), changed.
    """
    rows, cols = index.shape
    lowest, highest = records[:, BASE].min() - THIN, records[:, TOP].max() + THIN
    looks = np.zeros(len(records), np.uint8)
    for n in range(len(taken)):
        i = taken[n]
        if n > 0 and origin[i] != origin[taken[n - 1]]:
            _end_scan(looks, records)
        own_r = int(np.floor((points[i, 1] - south) / cell))
        own_c = int(np.floor((points[i, 0] - west) / cell))
        inside = 0 <= own_r < rows and 0 <= own_c < cols
        own = index[own_r, own_c] if inside else np.int32(-1)
        hit = own >= 0 and (raised[i] or records[own, BASE] - PAD <= points[i, 2] <= records[own, TOP] + PAD)
        if hit:
            records[own, RETURNED] += 1.0
            _note_look(index, own_r, own_c, around, HIT, looks, records)
        elif n % stride:
            continue
        o = origins[origin[i]]
        x, y, z = points[i, 0] - o[0], points[i, 1] - o[1], points[i, 2] - o[2]
        length = np.sqrt(x * x + y * y + z * z)
        if not length > 0.0:  # NaN too
            continue
        # The part of the ray between the heights of all records, and over the box of all columns.
        begin, end = _clip(o[2], z, lowest, highest, 0.0, 1.0)
        if not begin < end:
            continue
        begin, end = _clip(o[0], x, west, west + cols * cell, begin, end)
        begin, end = _clip(o[1], y, south, south + rows * cell, begin, end)
        if not begin < end:
            continue
        r = min(rows - 1, max(0, int(np.floor((o[1] + begin * y - south) / cell))))
        c = min(cols - 1, max(0, int(np.floor((o[0] + begin * x - west) / cell))))
        share = begin
        while share < end and 0 <= r < rows and 0 <= c < cols:
            wide, first_r, first_c = 1, r, c
            if not blocks[r >> BLOCK_BITS, c >> BLOCK_BITS]:
                wide, first_r, first_c = BLOCK, r & -BLOCK, c & -BLOCK
            next_r = (south + (first_r + (wide if y > 0 else 0)) * cell - o[1]) / y if y != 0.0 else np.inf
            next_c = (west + (first_c + (wide if x > 0 else 0)) * cell - o[0]) / x if x != 0.0 else np.inf
            leave = min(next_r, next_c, end)
            k = index[r, c]
            if k >= 0 and not (hit and k == own):
                low, high = o[2] + share * z, o[2] + leave * z
                low, high = min(low, high), max(low, high)
                if low <= records[k, TOP] + THIN and high >= records[k, BASE] - THIN:
                    way = x * records[k, EAST] + y * records[k, NORTH] + z * records[k, UP]
                    if way >= SAME_SIDE * length and share * length <= FARTHER * records[k, RANGE]:
                        records[k, SINCE] += 1.0 if hit else float(stride)
                        if looks[k] == 0:
                            _note_look(index, r, c, around, PASSED, looks, records)
            share = leave
            if wide > 1:  # to where the ray leaves the block
                r = min(first_r + wide - 1, max(first_r, int(np.floor((o[1] + share * y - south) / cell))))
                c = min(first_c + wide - 1, max(first_c, int(np.floor((o[0] + share * x - west) / cell))))
            if next_r <= next_c:
                r = first_r + wide if y > 0 else first_r - 1
            else:
                c = first_c + wide if x > 0 else first_c - 1
    _end_scan(looks, records)


@kernel
def passed(
    index: Array2D[np.int32], around: int, least_scans: float, records: Array2D[np.float64]
) -> tuple[Array1D[np.int64], Array2D[np.float64]]:
    """Return the records of columns not gone that rays of some scans passed, and (k, 6) what they count.

    Returned, passed before and passed since: rays of each column and those around, then scans.
    """
    which, counts, n = np.empty(len(records), np.int64), np.zeros((len(records), 6)), 0
    for r in range(around, index.shape[0] - around):
        for c in range(around, index.shape[1] - around):
            k = index[r, c]
            if k < 0 or records[k, GONE] or records[k, SINCE] < OWN or records[k, SCANS_SINCE] < least_scans:
                continue
            for i in range(r - around, r + around + 1):
                for j in range(c - around, c + around + 1):
                    other = index[i, j]
                    if other >= 0:
                        for field in range(3):
                            counts[n, field] += records[other, RETURNED + field]
            put(counts[n], 3, records[k, SCANS_RETURNED : SCANS_SINCE + 1])
            which[n] = k
            n += 1
    return which[:n].copy(), counts[:n].copy()
