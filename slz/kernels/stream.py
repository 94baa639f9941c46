"""From a window's points to its cells by the sources' rules, in two phases (SLZ paper §3.2.1-3.2.2).

The first phase streams through the points once and leaves 8 bytes of each: its cell and its height. The
second takes those, still in the cache, to the histogram of heights and to the cells.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.bits import signed
from slz.kernels.jit import kernel

Points = NDArray[np.float64]
DROPPED, OUTSIDE = np.uint32(0xFFFFFFFF), np.uint32(0xFFFFFFFE)
MOST_CELLS = 65_535  # along one side of a map: a cell's row and column are 16 bits each
MOST_HEIGHT_M = 100_000.0  # nothing on the ground is higher or deeper
CHUNK = 1024
FEW = 256  # points, of which seldom one lies near a bin's edge
BAND_BITS = 5  # 32 rows
BAND = 1 << BAND_BITS
HIGH, LOW32 = np.uint64(32), np.uint64(0xFFFFFFFF)
HALF, LOW16, NOTHING = np.uint32(16), np.uint32(0xFFFF), np.uint32(0)
ONE, TWO, THREE, SIX, NINE, TWELVE = (np.uint64(k) for k in (1, 2, 3, 6, 9, 12))
EDGE = 1e-7  # of a cell, below which a product may round to the other side of an edge than the quotient


@kernel(
    "boolean(Array(float64, 1, 'C', True), float64, float64, float64, int64, int64, float64, float64,"
    " float64, float64, uint32[::1], float32[::1])"
)
def _chunk(
    points: Points,
    west: float,
    south: float,
    cell: float,
    rows: int,
    cols: int,
    sensor_east: float,
    sensor_north: float,
    range2: float,
    level: float,
    cells: NDArray[np.uint32],
    heights: NDArray[np.float32],
) -> bool:
    """Place the points of a chunk by products; tell whether one lies so near an edge that it may be wrong.

    Without a branch and with indices that cannot be negative, so that the compiler takes four at a time.
    """
    per_m, wide, high = 1.0 / cell, float(cols), float(rows)
    near = 0
    for i in range(np.uint64(len(cells))):
        x, y, z = points[THREE * i], points[THREE * i + ONE], points[THREE * i + TWO]
        across, up = (x - west) * per_m, (y - south) * per_m
        dx, dy = x - sensor_east, y - sensor_north
        far = dx * dx + dy * dy
        col, row = np.floor(across), np.floor(up)
        inside = (col >= 0.0) & (col < wide) & (row >= 0.0) & (row < high)
        finite = (x - x == 0.0) & (y - y == 0.0) & (abs(z) < MOST_HEIGHT_M)
        used = finite & ((far <= range2) | (far != far))
        at = np.uint32((np.int32(row) << 16) | np.int32(col)) if inside else OUTSIDE
        cells[i] = at if used else DROPPED
        heights[i] = np.float32(z - level) if used else np.float32(0.0)
        from_col, from_row = abs(across - col - 0.5), abs(up - row - 0.5)
        near |= signed((from_col > 0.5 - EDGE) | (from_row > 0.5 - EDGE))
    return near != 0


@kernel("void(Array(float64, 1, 'C', True), float64, float64, float64, int64, int64, uint32[::1])")
def _exactly(
    points: Points, west: float, south: float, cell: float, rows: int, cols: int, cells: NDArray[np.uint32]
) -> None:
    """Place the points of a chunk by quotients (Eq. 3-4)."""
    for i in range(len(cells)):
        if cells[i] != DROPPED:
            col = np.floor((points[3 * i] - west) / cell)
            row = np.floor((points[3 * i + 1] - south) / cell)
            inside = col >= 0 and col < cols and row >= 0 and row < rows
            cells[i] = np.uint32((int(row) << 16) | int(col)) if inside else OUTSIDE


@kernel("UniTuple(uint32, 5)(uint32[::1])")
def _hit(cells: NDArray[np.uint32]) -> tuple[np.uint32, np.uint32, np.uint32, np.uint32, np.uint32]:
    """Return the least and greatest row and column, and the greatest of all."""
    row0, row1, col0, col1, most = LOW16, NOTHING, LOW16, NOTHING, NOTHING
    for i in range(len(cells)):
        row, col = cells[i] >> HALF, cells[i] & LOW16
        row0, row1, col0, col1 = min(row0, row), max(row1, row), min(col0, col), max(col1, col)
        most = max(most, cells[i])
    return row0, row1, col0, col1, most


@kernel("UniTuple(float64, 2)(Array(float64, 1, 'C', True), float64, float64)")
def _heights(points: Points, low: float, high: float) -> tuple[float, float]:
    """Return the lowest and highest of all points and of those given."""
    a0 = a1 = a2 = a3 = low
    b0 = b1 = b2 = b3 = high
    whole = len(points) // 12
    for i in range(np.uint64(whole)):
        k = TWELVE * i + TWO
        z0, z1, z2, z3 = points[k], points[k + THREE], points[k + SIX], points[k + NINE]
        a0, b0 = z0 if z0 < a0 else a0, z0 if z0 > b0 else b0
        a1, b1 = z1 if z1 < a1 else a1, z1 if z1 > b1 else b1
        a2, b2 = z2 if z2 < a2 else a2, z2 if z2 > b2 else b2
        a3, b3 = z3 if z3 < a3 else a3, z3 if z3 > b3 else b3
    for rest in range(12 * whole + 2, len(points), 3):
        a0, b0 = min(a0, points[rest]), max(b0, points[rest])
    return min(min(a0, a1), min(a2, a3)), max(max(b0, b1), max(b2, b3))


@kernel(
    "float64[:](Array(float64, 1, 'C', True), float64, float64, float64, int64, int64, float64[:],"
    " float64, uint32[::1], float32[::1])"
)
def stream(
    points: Points,
    west: float,
    south: float,
    cell: float,
    rows: int,
    cols: int,
    sensor: Points,
    range_m: float,
    cells: NDArray[np.uint32],
    heights: NDArray[np.float32],
) -> Points:
    """Place points in a grid; leave their cells and heights above the first.

    Parameters
    ----------
    points
        (3 n,) x, y, z one after the other. Those not finite, too high to be ground or beyond `range_m` of the
        sensor over ground (never where its place is NaN) are dropped.
    cells
        (n,) receives row << 16 | column, OUTSIDE or DROPPED.
    heights
        (n,) receives heights above the level that is returned.

    Returns
    -------
    level, lowest and highest height, points not dropped, of these outside; row0, row1, col0, col1 (half open)
    of the cells hit.
    """
    n = len(points) // 3
    level = 0.0
    for i in range(n):
        if abs(points[3 * i + 2]) < MOST_HEIGHT_M:
            level = points[3 * i + 2]
            break
    low, high, dropped, outside = np.inf, -np.inf, 0, 0
    row0, row1, col0, col1 = LOW16, NOTHING, LOW16, NOTHING
    for start in range(0, n, CHUNK):
        stop = min(n, start + CHUNK)
        some, mine = points[3 * start : 3 * stop], cells[start:stop]
        if _chunk(
            some, west, south, cell, rows, cols, sensor[0], sensor[1], range_m * range_m, level,
            mine, heights[start:stop],
        ):  # fmt: skip
            _exactly(some, west, south, cell, rows, cols, mine)
        r0, r1, c0, c1, most = _hit(mine)
        if most < OUTSIDE:
            row0, row1, col0, col1 = min(row0, r0), max(row1, r1), min(col0, c0), max(col1, c1)
            low, high = _heights(some, low, high)
            continue
        for i in range(stop - start):
            at = mine[i]
            if at == DROPPED:
                dropped += 1
                continue
            low, high = min(low, some[3 * i + 2]), max(high, some[3 * i + 2])
            if at == OUTSIDE:
                outside += 1
                continue
            row0, row1 = min(row0, at >> HALF), max(row1, at >> HALF)
            col0, col1 = min(col0, at & LOW16), max(col1, at & LOW16)
    return np.array([level, low, high, n - dropped, outside, row0, row1 + 1, col0, col1 + 1], np.float64)


@kernel("boolean(uint32[::1], float32[::1], float64, float64, int64, uint16[::1])")
def _bins(
    cells: NDArray[np.uint32],
    heights: NDArray[np.float32],
    shift: float,
    scale: float,
    bins: int,
    out: NDArray[np.uint16],
) -> bool:
    """Leave the bins of a chunk's heights, one more for those dropped; tell whether one may be wrong.

    That is so of a height so near a bin's edge that rounding to four bytes may have moved it over. Without a
    branch, so that the compiler takes four at a time.
    """
    near, last, odd = 0.5 - bins * 2.0**-22, np.int32(bins - 1), 0
    for i in range(np.uint64(len(cells))):
        at = (float(heights[i]) + shift) * scale
        b = np.int32(at)
        odd |= signed(abs(at - b - 0.5) > near)
        b = last if b > last else b
        out[i] = np.uint16(bins) if cells[i] == DROPPED else np.uint16(b)
    return odd != 0


@kernel(
    "UniTuple(float64, 2)(Array(float64, 1, 'C', True), uint32[::1], float32[::1], float64, float64, float64,"
    " int64, int64, float64)"
)
def interval(
    points: Points,
    cells: NDArray[np.uint32],
    heights: NDArray[np.float32],
    level: float,
    low: float,
    high: float,
    n: int,
    bins: int,
    threshold: float,
) -> tuple[float, float]:
    """Return the accepted heights of n points not dropped (SLZ paper §3.2.1, SLZ thesis §3.3.1.1).

    The sources give two numbers, 300 bins and a threshold of 0.9, without saying how the accepted interval is
    formed. Here an end bin is sparse when it holds less than (1 - threshold) of the mean bin population.
    Sparse end bins are trimmed, the emptier end first, while at least `threshold` of all points stay.

    A height that lies so near a bin's edge that rounding to four bytes may move it over is looked up.
    """
    if not high > low:
        return low, high
    count = np.zeros((4, bins + 1), np.int32)  # four, so that equal bins one after the other need not wait
    scale, shift = bins / (high - low), level - low
    mine, four = np.empty(FEW, np.uint16), np.uint64(3)
    for start in range(0, len(cells), FEW):
        some = slice(start, min(len(cells), start + FEW))
        if _bins(cells[some], heights[some], shift, scale, bins, mine):
            for i in range(some.start, some.stop):
                if cells[i] != DROPPED:
                    mine[i - start] = min(bins - 1, int((points[3 * i + 2] - low) * scale))
        for i in range(np.uint64(some.stop - some.start)):
            count[i & four, mine[i]] += 1
    sparse, first, last, left = (1 - threshold) * n / bins, 0, bins - 1, n
    while first < last:
        lower, upper = count[:, first].sum(), count[:, last].sum()
        fewer = min(lower, upper)
        if fewer >= sparse or left - fewer < threshold * n:
            break
        left -= fewer
        if lower <= upper:
            first += 1
        else:
            last -= 1
    return low + first / scale, low + (last + 1) / scale


@kernel(
    "int64(Array(float64, 1, 'C', True), uint32[::1], float32[::1], float64, float64, float64,"
    " float64, int64, int64, int64, int64, uint64[::1])"
)
def scatter(
    points: Points,
    cells: NDArray[np.uint32],
    heights: NDArray[np.float32],
    level: float,
    low: float,
    high: float,
    scale: float,
    count_bits: int,
    row0: int,
    col0: int,
    width: int,
    sums: NDArray[np.uint64],
) -> int:
    """Add up the heights between low and high of every cell of a box; return how many there are.

    A sum holds the number of points in its lowest `count_bits` bits and above them their heights over `low`
    in units of 1 / `scale` m: whole numbers, so that the order of the points does not matter.
    """
    shift, used, bits = level - low, 0, np.uint64(count_bits)
    top = high - low
    near = (abs(low - level) + abs(high - level)) * 2.0**-22
    for i in range(len(cells)):
        at = cells[i]
        if at == DROPPED:
            continue
        over = float(heights[i]) + shift
        if over < near or over > top - near:
            z = points[3 * i + 2]
            if z < low or z > high:
                continue
            over = z - low
        used += 1
        if at != OUTSIDE:
            k = (int(at >> HALF) - row0) * width + int(at & LOW16) - col0
            sums[k] += (np.uint64(int(over * scale + 0.5)) << bits) | np.uint64(1)
    return used


@kernel("int64[::1](uint32[::1], int64, int64)")
def _band_starts(cells: NDArray[np.uint32], row0: int, rows: int) -> NDArray[np.int64]:
    """Return where each band's points begin when they are sorted by bands."""
    bands = (rows + BAND - 1) // BAND
    count = np.zeros((4, bands), np.int64)
    for i in range(len(cells)):
        if cells[i] < OUTSIDE:
            count[i & 3, (signed(cells[i] >> HALF) - row0) >> BAND_BITS] += 1
    starts = np.zeros(bands + 1, np.int64)
    for b in range(bands):
        starts[b + 1] = starts[b] + count[0, b] + count[1, b] + count[2, b] + count[3, b]
    return starts


@kernel(
    "int64(Array(float64, 1, 'C', True), uint32[::1], float32[::1], float64, float64, float64,"
    " float64, int64, int64, int64, int64, int64, uint64[::1], uint64[::1])"
)
def scatter_by_bands(
    points: Points,
    cells: NDArray[np.uint32],
    heights: NDArray[np.float32],
    level: float,
    low: float,
    high: float,
    scale: float,
    count_bits: int,
    row0: int,
    rows: int,
    col0: int,
    width: int,
    sorted_: NDArray[np.uint64],
    sums: NDArray[np.uint64],
) -> int:
    """Do what `scatter` does, for a box larger than the cache: first the points are sorted by bands of rows.

    Parameters
    ----------
    sorted_
        (n,) scratch: a point's place in the sums and its height, 32 bits each.
    """
    at = _band_starts(cells, row0, rows)
    shift, used, bits = level - low, 0, np.uint64(count_bits)
    top = high - low
    near = (abs(low - level) + abs(high - level)) * 2.0**-22
    ends = at[:-1].copy()
    for i in range(len(cells)):
        cell = cells[i]
        if cell == DROPPED:
            continue
        over = float(heights[i]) + shift
        if over < near or over > top - near:
            z = points[3 * i + 2]
            if z < low or z > high:
                continue
            over = z - low
        used += 1
        if cell != OUTSIDE:
            row = signed(cell >> HALF) - row0
            k = row * width + signed(cell & LOW16) - col0
            band = row >> BAND_BITS
            sorted_[ends[band]] = (np.uint64(k) << HIGH) | np.uint64(signed(over * scale + 0.5))
            ends[band] += 1
    for band in range(len(ends)):
        for i in range(at[band], ends[band]):
            sums[signed(sorted_[i] >> HIGH)] += ((sorted_[i] & LOW32) << bits) | np.uint64(1)
    return used
