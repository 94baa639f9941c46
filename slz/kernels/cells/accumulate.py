"""Accumulation of points in cells."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slz.kernels.argument_types import (
    Array1D,
    Array2D,
    Array3D,
    Array4D,
    Array5D,
    Float32,
    Strided1D,
    Strided2D,
)
from slz.kernels.cells.cell_record import (
    COUNT,
    FIELDS,
    HIGH,
    HIGH2,
    LOW,
    LOW2,
    MEAN,
    NOISE,
    RECORD,
    TILE,
    TILE_BITS,
    TIME,
)
from slz.kernels.cells.tile_directory import Directory, slot_at
from slz.kernels.jit import kernel, kernel_at_call, kernel_part
from slz.kernels.simd import prefetch

OUTSIDE_BOX, INT32_MAX = np.int32(-(2**31)), np.int32(2**31 - 1)
PREFETCH_AHEAD = 24  # points between the prefetch of a cell and its use
BITS = np.int32(TILE_BITS)
CHUNK = 64  # points processed together
F1, F2 = np.float32(1), np.float32(2)
NEXT, PAIR, THREE = np.uint64(1), np.uint64(2), np.uint64(3)


@kernel_part
def _place(
    points: Array1D[np.float64], west: float, south: float, cell: float, out: Array2D[np.float64]
) -> None:
    """Write rows, columns and heights of points, without a branch, so that the compiler vectorises the loop.

    The heights are unused. But only if all three coordinates are read does the compiler load whole cache
    lines; else it gathers single numbers, which takes five times as long from memory.
    """
    rows, cols, heights = out[0], out[1], out[2]
    for k in range(np.uint64(len(points) // 3)):
        cols[k] = np.floor((points[THREE * k] - west) / cell)
        rows[k] = np.floor((points[THREE * k + NEXT] - south) / cell)
        heights[k] = points[THREE * k + PAIR]


@kernel
def cells_of(
    points: Array2D[np.float64],
    west: float,
    south: float,
    cell: float,
    within: Strided1D[np.int64],
) -> tuple[Array2D[np.int32], Array1D[np.int64]]:
    """Return (n, 2) row and column of each point, and row0, row1, col0, col1 (half open) and count inside.

    Cells count from (west, south). Points outside `within` (row0, row1, col0, col1) get row `OUTSIDE_BOX`.
    """
    at, placed = np.empty((len(points), 2), np.int32), np.empty((3, CHUNK))
    south0, north0, west0, east0 = within[0] + 0.0, within[1] + 0.0, within[2] + 0.0, within[3] + 0.0
    r0, r1, c0, c1, inside = north0, south0 - 1, east0, west0 - 1, 0
    flat, places, rows, cols = points.ravel(), at.ravel(), placed[0], placed[1]
    for start in range(0, len(points), CHUNK):
        n, to = min(CHUNK, len(points) - start), np.uint64(2 * start)
        _place(flat[3 * start : 3 * (start + n)], west, south, cell, placed)
        held = 0
        for k in range(np.uint64(n)):
            r, c = rows[k], cols[k]
            held += (r >= south0) & (r < north0) & (c >= west0) & (c < east0)
        if held < n:
            for k in range(np.uint64(n)):
                r, c = rows[k], cols[k]
                here = (r >= south0) & (r < north0) & (c >= west0) & (c < east0)
                places[to + PAIR * k], places[to + PAIR * k + NEXT] = OUTSIDE_BOX, 0
                if here:
                    places[to + PAIR * k], places[to + PAIR * k + NEXT] = np.int32(r), np.int32(c)
                    r0, r1, c0, c1 = min(r0, r), max(r1, r), min(c0, c), max(c1, c)
        else:
            least_row, most_row, least_col, most_col = INT32_MAX, OUTSIDE_BOX, INT32_MAX, OUTSIDE_BOX
            for k in range(np.uint64(n)):
                row, col = np.int32(rows[k]), np.int32(cols[k])
                places[to + PAIR * k], places[to + PAIR * k + NEXT] = row, col
                least_row, most_row = min(least_row, row), max(most_row, row)
                least_col, most_col = min(least_col, col), max(most_col, col)
            r0, r1 = min(r0, float(least_row)), max(r1, float(most_row))
            c0, c1 = min(c0, float(least_col)), max(c1, float(most_col))
        inside += held
    return at, np.array([np.int64(r0), np.int64(r1) + 1, np.int64(c0), np.int64(c1) + 1, inside], np.int64)


@kernel_at_call
def sum_and_count(
    points: Strided2D[np.float64],
    west: float,
    south: float,
    cell: float,
    row0: int,
    col0: int,
    total: Strided2D[np.float64],
    count: Strided2D[np.int32],
) -> None:
    """Add heights and counts of points to every cell of a box, whose quotient is SLZ paper, Eq. (5)."""
    rows, cols = total.shape
    for i in range(points.shape[0]):
        c = int(np.floor((points[i, 0] - west) / cell)) - col0  # SLZ paper, Eq. (3)
        r = int(np.floor((points[i, 1] - south) / cell)) - row0  # SLZ paper, Eq. (4)
        if c < 0 or r < 0 or c >= cols or r >= rows:
            continue
        total[r, c] += points[i, 2]
        count[r, c] += 1


@kernel
def hit_squares(
    points: Array2D[np.float64], west: float, south: float, side: float, rows: int, cols: int
) -> tuple[int, int]:
    """Return how many of rows x cols squares, fewer than 2^31, from (west, south) on, hold a point.

    The second result is 1 if some point is in none of them, else 0.
    """
    out, placed, at = np.zeros(rows * cols + 1, np.bool_), np.empty((3, CHUNK)), np.empty(CHUNK, np.int32)
    flat, row, col = points.ravel(), placed[0], placed[1]
    high, wide, elsewhere = float(rows), float(cols), np.int32(rows * cols)
    for start in range(0, len(points), CHUNK):
        n = min(CHUNK, len(points) - start)
        _place(flat[3 * start : 3 * (start + n)], west, south, side, placed)
        for k in range(np.uint64(n)):
            r, c = row[k], col[k]
            inside = (r >= 0.0) & (r < high) & (c >= 0.0) & (c < wide)
            at[k] = np.int32(r * wide + c) if inside else elsewhere
        for k in range(np.uint64(n)):
            out[np.uint64(at[k])] = True
    return int(np.count_nonzero(out[:-1])), int(out[-1])


@kernel_part
def _tiles_of(
    at: Array1D[np.int32], wide: np.int32, first: np.int32, elsewhere: np.int32, tile: Array1D[np.int32]
) -> None:
    """Write the index of each cell's tile, in rows of `wide`, less the first; 32-bit throughout."""
    for k in range(np.uint64(len(at) // 2)):
        row, col = at[PAIR * k], at[PAIR * k + NEXT]
        number = np.int32(np.int32(row >> BITS) * wide) + np.int32(np.int32(col >> BITS) - first)
        tile[k] = np.int32(number) if row != OUTSIDE_BOX else elsewhere


@kernel
def count_by_tile(
    at: Array2D[np.int32], tile_row: int, tile_col: int, rows: int, cols: int
) -> Array2D[np.int64]:
    """Count the cells in each tile of a rectangle of rows x cols tiles, from (tile_row, tile_col) on.

    Two tables are used, so that successive increments of one count need not wait.
    """
    count, tile = np.zeros((2, rows * cols + 1), np.int64), np.empty(CHUNK, np.int32)
    flat, wide, elsewhere = at.ravel(), np.int32(cols), np.int32(rows * cols)
    for start in range(0, len(at), CHUNK):
        stop = min(len(at), start + CHUNK)
        _tiles_of(flat[2 * start : 2 * stop], wide, np.int32(tile_row * cols + tile_col), elsewhere, tile)
        for k in range(np.uint64(stop - start)):
            count[k & NEXT, np.uint64(tile[k])] += 1
    return (count[0, :-1] + count[1, :-1]).reshape(rows, cols)


@kernel_part
def _sample(
    points: Array1D[np.float64],
    sensor: Strided1D[np.float64],
    range_noise_m: float,
    angle_noise_rad: float,
    sample: Array2D[np.float32],
) -> None:
    """Write heights and their variances of points, see `sorted_by_tile`; vectorised."""
    height, variance = sample[0], sample[1]
    east, north, up = sensor[0], sensor[1], sensor[2]
    own, across_m2 = range_noise_m**2, angle_noise_rad**2
    for k in range(np.uint64(len(points) // 3)):
        x, y, z = points[THREE * k], points[THREE * k + NEXT], points[THREE * k + PAIR]
        dx, dy, dz = x - east, y - north, z - up
        across = dx * dx + dy * dy
        whole = across + dz * dz
        noise = own * dz * dz / (whole if whole > 1e-6 else 1e-6) + across_m2 * across
        # The noise is NaN where the position of the sensor is unknown.
        height[k], variance[k] = np.float32(z), np.float32(noise if noise == noise else own)


@kernel
def sorted_by_tile(
    points: Array2D[np.float64],
    at: Array2D[np.int32],
    sensor: Strided1D[np.float64],
    range_noise_m: float,
    angle_noise_rad: float,
    tile_row: int,
    tile_col: int,
    count: Array2D[np.int64],
) -> tuple[Array1D[np.int32], Array2D[np.float32]]:
    """Return the points sorted by tile, in their order within each tile.

    Random access to cells of all tiles would wait for memory each time; the cells of one tile are close
    together.

    Parameters
    ----------
    at
        Cells of the points, see `cells_of`; points outside are left out.
    count
        Number of points in each tile, see `count_by_tile`.

    Returns
    -------
    Cell within the tile, row-major; (n, 2) height and its variance from the sensor's noise: of the range
    along the ray, and of the angle across it.
    """
    rows, cols = count.shape
    place, n = np.zeros(rows * cols + 1, np.int64), 0  # the last place is for points outside
    for k in range(rows * cols):
        n += int(count.flat[k])
        place[k + 1] = n
    cell, sample = np.empty(n + 1, np.int32), np.empty((n + 1, 2), np.float32)
    tile, some = np.empty(CHUNK, np.int32), np.empty((2, CHUNK), np.float32)
    flat, cells = points.ravel(), at.ravel()
    wide, elsewhere, within = np.int32(cols), np.int32(rows * cols), np.int32(TILE - 1)
    for start in range(0, len(at), CHUNK):
        stop = min(len(at), start + CHUNK)
        mine = cells[2 * start : 2 * stop]
        _tiles_of(mine, wide, np.int32(tile_row * cols + tile_col), elsewhere, tile)
        _sample(flat[3 * start : 3 * stop], sensor, range_noise_m, angle_noise_rad, some)
        for k in range(np.uint64(stop - start)):
            own = np.uint64(tile[k])
            to = np.uint64(place[own])
            place[own] += tile[k] != elsewhere
            cell[to] = (mine[PAIR * k] & within) << BITS | (mine[PAIR * k + NEXT] & within)
            sample[to, 0], sample[to, 1] = some[0, k], some[1, k]
    return cell[:n], sample[:n]


@kernel_part
def _accumulate_in_tile(
    cells: Array1D[np.int32],
    samples: Array2D[np.float32],
    now_s: Float32,
    hold_s: Float32,
    max_age_s: Float32,
    tile: Array3D[np.float32],
    hits: Array1D[np.uint64],
) -> tuple[int, int, int, int]:
    """Add the points of a tile to its cells, see `accumulate`; return the box of the cells hit."""
    r0, r1, c0, c1 = TILE, -1, TILE, -1
    flat, last = tile.ravel(), len(cells) - 1
    for i in range(len(cells)):
        prefetch(flat, 2 * FIELDS * cells[min(i + PREFETCH_AHEAD, last)])
        r, c = cells[i] >> TILE_BITS, cells[i] & (TILE - 1)
        r0, r1, c0, c1 = min(r0, r), max(r1, r), min(c0, c), max(c1, c)
        hits[r] |= NEXT << np.uint64(c)
        h, variance = samples[i, 0], samples[i, 1]
        held = tile[cells[i]]
        now, before = held[0], held[1]
        if now_s - before[TIME] > max_age_s:
            now[COUNT] = before[COUNT] = 0
        if now[COUNT] > 0 and now_s - now[TIME] > hold_s:
            for f in range(FIELDS):
                before[f] = now[f]
            now[COUNT] = 0
        if now[COUNT] == 0:
            now[COUNT], now[MEAN], now[NOISE], now[TIME] = 1, h, variance, now_s
            now[LOW] = now[LOW2] = now[HIGH] = now[HIGH2] = h
        else:
            # No branch: extremes are unpredictable.
            n = now[COUNT] + F1
            low, high = now[LOW], now[HIGH]
            above, below = (h if h > low else low), (h if h < high else high)
            low2 = above if above < now[LOW2] else now[LOW2]
            high2 = below if below > now[HIGH2] else now[HIGH2]
            now[LOW2], now[HIGH2] = (above, below) if n == F2 else (low2, high2)
            now[LOW], now[HIGH] = (h if h < low else low), (h if h > high else high)
            now[COUNT] = n
            now[MEAN] += (h - now[MEAN]) / n
            now[NOISE] += (variance - now[NOISE]) / n
        before[TIME] = now_s
    return r0, r1 + 1, c0, c1 + 1


@kernel
def accumulate(
    cells: Array1D[np.int32],
    samples: Array2D[np.float32],
    count: Array2D[np.int64],
    tile_row: int,
    tile_col: int,
    now_s: Float32,
    hold_s: Float32,
    max_age_s: Float32,
    pool: Array5D[np.float32],
    table: Array2D[np.int32],
    hit_boxes: Array3D[np.int64],
    hits: Array3D[np.uint64],
) -> int:
    """Add points, sorted by tile, to the per-cell statistics; return how many were used.

    `table` holds the slot in the pool of each tile, -1 where there is none. `hit_boxes` receives row0, row1,
    col0, col1 (half open) of the cells hit in each tile, and `hits` a bit for each: a word a row.

    A cell has a current and a previous epoch. When new points arrive and the current epoch is older than
    `hold_s`, it becomes the previous one. So an observation counts for at least `hold_s`, and until two
    epochs of newer observations have replaced it. A cell not seen for `max_age_s` is cleared first. NOISE is
    the mean variance of the heights due to the sensor's noise.
    """
    first = used = 0
    for tr in range(count.shape[0]):
        for tc in range(count.shape[1]):
            n, slot = count[tr, tc], table[tr, tc]
            if n > 0 and slot >= 0:
                tile = pool[slot].reshape(TILE * TILE, 2, FIELDS)
                cell, sample = cells[first : first + n], samples[first : first + n]
                r0, r1, c0, c1 = _accumulate_in_tile(
                    cell, sample, now_s, hold_s, max_age_s, tile, hits[tr, tc]
                )
                south, west = (tile_row + tr) * TILE, (tile_col + tc) * TILE
                box = hit_boxes[tr, tc]
                box[0], box[1], box[2], box[3] = south + r0, south + r1, west + c0, west + c1
                used += n
            first += n
    return used


@kernel_part
def copy_evidence(
    pool: Array5D[np.float32],
    table: Strided2D[np.int32],
    tile_row: int,
    tile_col: int,
    row0: int,
    col0: int,
    out: Array4D[np.float32],
) -> None:
    """Copy the evidence of the cells from (row0, col0) on into an array of zeros."""
    rows, cols = out.shape[:2]
    flat, into = pool.ravel(), out.ravel()
    for r in range(rows):
        tr, i = ((row0 + r) >> TILE_BITS) - tile_row, (row0 + r) & (TILE - 1)
        for c in range(cols):
            slot = table[tr, ((col0 + c) >> TILE_BITS) - tile_col]
            first = ((slot * TILE + i) * TILE + ((col0 + c) & (TILE - 1))) * RECORD
            if slot >= 0 and flat[first + COUNT] > 0:
                to = (r * cols + c) * RECORD
                for k in range(np.uint64(RECORD)):
                    into[np.uint64(to) + k] = flat[np.uint64(first) + k]


@kernel_part
def mean_height(now: Strided1D[np.float32], before: Strided1D[np.float32]) -> np.float32:
    """Return the mean height of both epochs of a cell that was hit."""
    return np.float32((now[COUNT] * now[MEAN] + before[COUNT] * before[MEAN]) / (now[COUNT] + before[COUNT]))


@kernel_part
def _evidence_of(
    points: Strided2D[np.float64],
    rows: Array1D[np.int64],
    west: float,
    south: float,
    cell: float,
    flat: Array1D[np.float32],
    directory: Directory,
    cells: Array2D[np.int32],
    at: Array1D[np.int64],
) -> None:
    """Write where in the evidence the cells under rows of points begin, negative where there are none.

    Memory is asked for all of them together: random access to cells would wait each time.
    """
    for k in range(len(rows)):
        cells[0, k] = np.int32(np.floor((points[rows[k], 1] - south) / cell))
        cells[1, k] = np.int32(np.floor((points[rows[k], 0] - west) / cell))
    tile_row = tile_col = slot = -1
    for k in range(len(rows)):
        r, c = int(cells[0, k]), int(cells[1, k])
        if k == 0 or r >> TILE_BITS != tile_row or c >> TILE_BITS != tile_col:
            tile_row, tile_col, slot = r >> TILE_BITS, c >> TILE_BITS, slot_at(directory, r, c)
        at[k] = -1
        if slot >= 0:
            at[k] = ((slot * TILE + (r & (TILE - 1))) * TILE + (c & (TILE - 1))) * 2 * FIELDS
            prefetch(flat, at[k])


@kernel
def mark_above(
    points: Array2D[np.float64],
    flags: Array1D[np.uint16],
    has: int,
    lacks: int,
    mark: int,
    sensor: Strided1D[np.float64],
    least_m: float,
    angle_noise_rad: float,
    west: float,
    south: float,
    cell: float,
    pool: Array5D[np.float32],
    directory: Directory,
) -> None:
    """Set a flag of the points that are higher than known ground of their cell by more than noise explains.

    Only points whose flags hold all of `has` and none of `lacks` count. The bound is `least_m` plus four
    standard deviations of a height at the point's horizontal distance.
    """
    flat, asked, n = pool.ravel(), has | lacks, 0
    rows, cells, at = np.empty(CHUNK, np.int64), np.empty((2, CHUNK), np.int32), np.empty(CHUNK, np.int64)
    for row in range(len(points)):
        rows[n] = row
        n += (flags[row] & asked) == has
        if n < CHUNK and row + 1 < len(points):
            continue
        _evidence_of(points, rows[:n], west, south, cell, flat, directory, cells, at)
        for k in range(n):
            i, first = rows[k], at[k]
            if first < 0 or flat[first + COUNT] == 0:
                continue
            known, before = flat[first + HIGH], first + FIELDS
            if flat[before + COUNT] > 0:
                known = max(known, flat[before + HIGH])
            way = np.sqrt((points[i, 0] - sensor[0]) ** 2 + (points[i, 1] - sensor[1]) ** 2)
            if points[i, 2] - known > least_m + 4 * angle_noise_rad * way:
                flags[i] |= np.uint16(mark)
        n = 0


def contradicts(points: NDArray[np.float64], *known: Any) -> NDArray[np.bool_]:
    """Return which points are higher than the known ground of their cell by more than noise explains.

    known: the parameters of `mark_above` from `sensor` on.
    """
    flags = np.zeros(len(points), np.uint16)
    mark_above(np.ascontiguousarray(points), flags, 0, 0, 1, *known)
    return flags > 0


@kernel
def differences(
    points: Strided2D[np.float64],
    rows: Array1D[np.int64],
    lower_m: float,
    west: float,
    south: float,
    cell: float,
    pool: Array5D[np.float32],
    directory: Directory,
) -> Strided2D[np.float64]:
    """Return (m, 4) east, north, height above the cell's mean, and index, of the points over known cells.

    Parameters
    ----------
    points, rows, lower_m
        (n, 3), those to compare, to whose indices the result refers, and by how much they are lowered.
    """
    flat, out, m = pool.ravel(), np.empty((len(rows), 4)), 0
    cells, at = np.empty((2, CHUNK), np.int32), np.empty(CHUNK, np.int64)
    for start in range(0, len(rows), CHUNK):
        some = rows[start : start + CHUNK]
        _evidence_of(points, some, west, south, cell, flat, directory, cells, at)
        for k in range(len(some)):
            i, first = some[k], at[k]
            if first < 0 or flat[first + COUNT] == 0:
                continue
            now, before = flat[first : first + FIELDS], flat[first + FIELDS : first + 2 * FIELDS]
            over = points[i, 2] - lower_m - mean_height(now, before)
            out[m, 0], out[m, 1], out[m, 2], out[m, 3] = points[i, 0], points[i, 1], over, start + k
            m += 1
    return out[:m].copy()
