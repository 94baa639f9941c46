"""Single pass over a window's points in source mode: cell and height of each (SLZ paper, section 3.2.1).

It leaves 8 bytes a point, for the histogram of heights (`height_gate.accepted_interval`) and for the sums of
the cells (`height_sums.sum_heights`).
"""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, ReadOnly1D, Strided1D
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.raster.bitmap import signed

DROPPED, OUTSIDE = np.uint32(0xFFFFFFFF), np.uint32(0xFFFFFFFE)
MOST_CELLS = 65_535  # along one side of a map: row and column of a cell have 16 bits each
MOST_HEIGHT_M = 100_000.0  # nothing on the ground is higher or deeper
CHUNK = 512
HALF_BITS, LOW16, ZERO = np.uint32(16), np.uint32(0xFFFF), np.uint32(0)
INT32_MAX, INT32_MIN, SIGN = np.int32(0x7FFFFFFF), np.int32(-0x7FFFFFFF), np.int32(31)  # of int32
ONE, TWO, THREE, SIX, NINE, TWELVE = (np.uint64(k) for k in (1, 2, 3, 6, 9, 12))
EDGE_TOLERANCE = (
    1e-7  # cells: closer to an edge, a product may round to its other side than the quotient does
)


@kernel_part
def _place_chunk(
    points: ReadOnly1D[np.float64],
    west: float,
    south: float,
    cell: float,
    rows: int,
    cols: int,
    sensor_east: float,
    sensor_north: float,
    range2: float,
    level: float,
    cells: Array1D[np.uint32],
    heights: Array1D[np.float32],
) -> bool:
    """Place the points of a chunk using products; return whether one is too near an edge to be certain.

    The loop has no branch and its indices are unsigned, so that the compiler vectorises it.
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
        near |= signed((from_col > 0.5 - EDGE_TOLERANCE) | (from_row > 0.5 - EDGE_TOLERANCE))
    return near != 0


@kernel_part
def _place_exactly(
    points: ReadOnly1D[np.float64],
    west: float,
    south: float,
    cell: float,
    rows: int,
    cols: int,
    cells: Array1D[np.uint32],
) -> None:
    """Place the points of a chunk using quotients."""
    for i in range(len(cells)):
        if cells[i] != DROPPED:
            col = np.floor((points[3 * i] - west) / cell)  # SLZ paper, Eq. (3)
            row = np.floor((points[3 * i + 1] - south) / cell)  # SLZ paper, Eq. (4)
            inside = col >= 0 and col < cols and row >= 0 and row < rows
            cells[i] = np.uint32((int(row) << 16) | int(col)) if inside else OUTSIDE


@kernel_part
def _chunk_extremes(
    cells: Array1D[np.uint32], heights: Array1D[np.int32]
) -> tuple[np.uint32, np.uint32, np.uint32, np.uint32, np.int32, np.int32]:
    """Return the least and greatest cell, the least and greatest column, the least and greatest height.

    Heights are float32 bit patterns with the magnitude bits of negative numbers inverted: as int32 these have
    the order of the floats, and the compiler vectorises their comparison. It does so in 32 bits only where no
    intermediate is wider, such as a result of `min`.
    """
    first, last, col0, col1 = OUTSIDE, ZERO, LOW16, ZERO
    low, high = INT32_MAX, INT32_MIN
    for i in range(np.uint64(len(cells))):
        cell, col = cells[i], np.uint32(cells[i] & LOW16)
        first, last = cell if cell < first else first, cell if cell > last else last
        col0, col1 = col if col < col0 else col0, col if col > col1 else col1
        height = np.int32(heights[i] ^ np.int32(np.int32(heights[i] >> SIGN) & INT32_MAX))
        low, high = height if height < low else low, height if height > high else high
    return first, last, col0, col1, low, high


@kernel_part
def _height_range(points: ReadOnly1D[np.float64], low: float, high: float) -> tuple[float, float]:
    """Return the lowest and highest of all points and of the two given heights."""
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


@kernel_part
def _first_height(
    points: ReadOnly1D[np.float64], sensor_east: float, sensor_north: float, range2: float
) -> float:
    """Return the height of the first point that is not dropped; 0 for none."""
    for i in range(len(points) // 3):
        x, y, z = points[3 * i], points[3 * i + 1], points[3 * i + 2]
        dx, dy = x - sensor_east, y - sensor_north
        far = dx * dx + dy * dy > range2
        if x - x == 0.0 and y - y == 0.0 and abs(z) < MOST_HEIGHT_M and not far:
            return float(z)
    return 0.0


@kernel
def place_points(
    points: ReadOnly1D[np.float64],
    west: float,
    south: float,
    cell: float,
    rows: int,
    cols: int,
    sensor: Strided1D[np.float64],
    range_m: float,
    level: float,
    cells: Array1D[np.uint32],
    heights: Array1D[np.float32],
) -> Strided1D[np.float64]:
    """Place points in a grid; write their cells and their heights above a level.

    Parameters
    ----------
    points
        (3 n,) interleaved x, y, z. Points that are not finite, too high to be ground or farther than
        `range_m` from the sensor horizontally (no limit where its position is NaN) are dropped.
    level
        NaN selects the height of the first point not dropped. The rounding of a height grows with its
        distance from the level.
    cells
        (n,) receives row << 16 | column, OUTSIDE or DROPPED.
    heights
        (n,) receives heights above the level.

    Returns
    -------
    level, lowest and highest height, points not dropped, how many of these are outside; row0, row1, col0,
    col1 (half open) of the cells hit.
    """
    n = len(points) // 3
    if level != level:  # NaN
        level = _first_height(points, sensor[0], sensor[1], range_m * range_m)
    low, high, dropped, outside = np.inf, -np.inf, 0, 0
    bits, least, greatest = heights.view(np.int32), INT32_MAX, INT32_MIN
    row0, row1, col0, col1 = LOW16, ZERO, LOW16, ZERO
    for start in range(0, n, CHUNK):
        stop = min(n, start + CHUNK)
        some, mine = points[3 * start : 3 * stop], cells[start:stop]
        if _place_chunk(
            some, west, south, cell, rows, cols, sensor[0], sensor[1], range_m * range_m, level,
            mine, heights[start:stop],
        ):  # fmt: skip
            _place_exactly(some, west, south, cell, rows, cols, mine)
        first, last, c0, c1, lower, upper = _chunk_extremes(mine, bits[start:stop])
        if last < OUTSIDE:
            row0, row1 = min(row0, first >> HALF_BITS), max(row1, last >> HALF_BITS)
            col0, col1 = min(col0, c0), max(col1, c1)
            if lower <= least or upper >= greatest:  # in float32: the extremes in float64 are among these
                least, greatest = min(least, lower), max(greatest, upper)
                low, high = _height_range(some, low, high)
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
            row0, row1 = min(row0, at >> HALF_BITS), max(row1, at >> HALF_BITS)
            col0, col1 = min(col0, at & LOW16), max(col1, at & LOW16)
    return np.array([level, low, high, n - dropped, outside, row0, row1 + 1, col0, col1 + 1], np.float64)
