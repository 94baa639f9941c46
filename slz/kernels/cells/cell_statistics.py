"""Cell statistics: height, bottom, top and noise of the ground, from a cell's and its neighbours' returns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.argument_types import Array1D, Array2D, Array3D, Float32
from slz.kernels.cells.cell_record import (
    BOTTOM,
    COUNT,
    EXCESS,
    FIELDS,
    HEIGHT,
    HIGH,
    HIGH2,
    LOW,
    LOW2,
    MEAN,
    NOISE,
    RECORD,
    SPREAD,
    SUMMARY_LAYERS,
    TILE,
    TILE_BITS,
    TIME,
    TOP,
    WEIGHT,
)
from slz.kernels.jit import kernel, kernel_for_any_types, kernel_part
from slz.kernels.raster.bitmap import NONE
from slz.kernels.simd import (
    LANES,
    Floats,
    broadcast,
    columns,
    flags_of,
    load,
    logical_and,
    maximum,
    minimum,
    store,
    where,
)


@kernel
def raise_tops(
    points: Array2D[np.float64],
    west: float,
    south: float,
    cell: float,
    reach: int,
    cells: Array3D[np.float32],
) -> None:
    """Raise the tops of the cells under points (n, 3); unknown cells stay unknown.

    Where the cell below a point is unknown, the known ones within `reach` cells are raised: they may make it
    count as seen.

    Parameters
    ----------
    cells
        (6, rows, cols) of `slz.kernels.cells.cell_statistics.summarise`, from (west, south) on.
    """
    rows, cols = cells.shape[1:]
    for i in range(len(points)):
        c = int(np.floor((points[i, 0] - west) / cell))
        r = int(np.floor((points[i, 1] - south) / cell))
        if r < -reach or c < -reach or r >= rows + reach or c >= cols + reach:
            continue
        z = np.float32(points[i, 2])
        inside = 0 <= r < rows and 0 <= c < cols
        if inside and cells[WEIGHT, r, c] > 0:
            cells[TOP, r, c] = max(cells[TOP, r, c], z)
            continue
        for rr in range(max(0, r - reach), min(rows, r + reach + 1)):
            for cc in range(max(0, c - reach), min(cols, c + reach + 1)):
                if cells[WEIGHT, rr, cc] > 0:
                    cells[TOP, rr, cc] = max(cells[TOP, rr, cc], z)


FEW_RETURNS = np.float32(20)  # returns of 3 x 3 cells, up to which extremes need no support
# Returns of a cell, above which a hazard shows in more than one of them: a wire takes a fortieth of the rays,
# a hole all that enter it.
CROWD, CROWD_BELOW = np.float32(64), np.float32(32)
STRAY = np.float32(0.5)  # m beyond the supported extreme, above which a return is left out of the mean

# Layers of a row during evaluation, for both epochs together and then for the current one: number of returns,
# highest, second highest, lowest, second lowest, and support up and down that the cell lends to neighbours.
COUNTED, ROW_MAX, ROW_MAX2, ROW_MIN, ROW_MIN2, UP, DOWN = range(7)
EPOCH = 7
MEAN_HEIGHT, MEAN_NOISE = 2 * EPOCH, 2 * EPOCH + 1
ROW_LAYERS = 2 * EPOCH + 2

F0, F1, NAN = np.float32(0), np.float32(1), np.float32(np.nan)
HIGHEST, LOWEST = np.float32(np.inf), np.float32(-np.inf)
Row = Array1D[np.float32]
Layers = Array3D[np.float32]


@kernel
def expected_maximum(n: float) -> float:
    """Return the expected maximum of n > 8 standard normal numbers (Gumbel limit; 7 % too large at n = 9)."""
    root = np.sqrt(2 * np.log(n))
    return float(root - (np.log(np.log(n)) + np.log(4 * np.pi) - 2 * 0.5772) / (2 * root))


ALONE = np.float32(8)  # returns, up to which the excess is 0
TABLE_LENGTH = 1024
BEYOND_ONE = np.array([expected_maximum(float(n)) - 1 if n > 8 else 0.0 for n in range(TABLE_LENGTH)])


@kernel_for_any_types
def _store_epoch(
    held: Row, width: int, at: int, n: Floats, most: Floats, most2: Floats, least: Floats, least2: Floats
) -> None:
    nobody = n == broadcast(F0)
    up, down = n < broadcast(CROWD), n < broadcast(CROWD_BELOW)
    store(held, at + COUNTED * width, n)
    store(held, at + ROW_MAX * width, most)
    store(held, at + ROW_MAX2 * width, most2)
    store(held, at + ROW_MIN * width, least)
    store(held, at + ROW_MIN2 * width, least2)
    store(held, at + UP * width, where(nobody, broadcast(LOWEST), where(up, most, most2)))
    store(held, at + DOWN * width, where(nobody, broadcast(HIGHEST), where(down, least, least2)))


@kernel_part
def _store_empty(held: Row, at: int, width: int) -> None:
    """Write 16 cells without a return."""
    for layer in range(ROW_LAYERS):
        store(held, at + layer * width, broadcast(F0))
    for epoch in range(2):
        store(held, at + (epoch * EPOCH + UP) * width, broadcast(LOWEST))
        store(held, at + (epoch * EPOCH + DOWN) * width, broadcast(HIGHEST))


@kernel_part
def _read_lanes(
    records: Row, first: int, now_s: Float32, max_age_s: Float32, held: Row, at: int, width: int
) -> None:
    """Write the evidence of 16 cells as layers; evidence that is too old counts as no return."""
    nothing, one, cell = broadcast(F0), broadcast(F1), columns(records, first)
    old = broadcast(max_age_s) < broadcast(now_s) - cell[FIELDS + TIME]
    n, mean, noise = where(old, nothing, cell[COUNT]), cell[MEAN], cell[NOISE]
    pair, most, least = one < n, cell[HIGH], cell[LOW]
    most2, least2 = where(pair, cell[HIGH2], broadcast(LOWEST)), where(pair, cell[LOW2], broadcast(HIGHEST))
    _store_epoch(held, width, at + EPOCH * width, n, most, most2, least, least2)

    n_then = where(n == nothing, nothing, cell[FIELDS + COUNT])
    also, pair, high, low = nothing < n_then, one < n_then, cell[FIELDS + HIGH], cell[FIELDS + LOW]
    high2, low2 = where(pair, cell[FIELDS + HIGH2], most2), where(pair, cell[FIELDS + LOW2], least2)
    most2 = where(also, maximum(minimum(most, high), maximum(most2, high2)), most2)
    least2 = where(also, minimum(maximum(least, low), minimum(least2, low2)), least2)
    most, least = where(also, maximum(most, high), most), where(also, minimum(least, low), least)
    _store_epoch(held, width, at, n + n_then, most, most2, least, least2)
    total = n + n_then
    mean_then, noise_then = cell[FIELDS + MEAN], cell[FIELDS + NOISE]
    store(held, at + MEAN_HEIGHT * width, where(also, (mean * n + mean_then * n_then) / total, mean))
    store(held, at + MEAN_NOISE * width, where(also, (noise * n + noise_then * n_then) / total, noise))


@kernel_part
def _read_row(
    records: Row,
    places: Array2D[np.int64],
    r: int,
    first: int,
    count: int,
    now_s: Float32,
    max_age_s: Float32,
    held: Row,
    at: int,
    width: int,
) -> None:
    """Write the evidence of a row, from cell `first` of its first stretch on, in whole lanes."""
    for c in range(first, first + count, LANES):
        stretch, there = c // TILE, RECORD * (c % TILE)
        place = places[r, stretch]
        if place < 0:
            _store_empty(held, at + c - first, width)
        else:
            _read_lanes(records, RECORD * place + there, now_s, max_age_s, held, at + c - first, width)


@kernel_for_any_types
def _nearby(held: Row, south: int, here: int, north: int) -> Floats:
    """Return the numbers of returns of 3 x 3 cells."""
    nearby = broadcast(F0)
    for row in (south, here, north):
        for at in range(row - 1, row + 2):
            nearby = nearby + load(held, at)
    return nearby


@kernel_for_any_types
def _supported(
    held: Row,
    width: int,
    south: int,
    here: int,
    north: int,
    nearby: Floats,
    top_alone: Floats,
    bottom_alone: Floats,
) -> tuple[Floats, Floats]:
    """Return the supported top and bottom of cells, see `summarise`.

    nearby: returns of both epochs there. top_alone, bottom_alone: where no return supports the only one.
    """
    n, most, least = load(held, here), load(held, here + ROW_MAX * width), load(held, here + ROW_MIN * width)
    most2, least2 = load(held, here + ROW_MAX2 * width), load(held, here + ROW_MIN2 * width)
    up, down = broadcast(LOWEST), broadcast(HIGHEST)
    for row in (south, here, north):
        for at in range(row - 1, row + 2):
            if at != here:
                up = maximum(up, load(held, at + UP * width))
                down = minimum(down, load(held, at + DOWN * width))
    most2 = where(n < broadcast(CROWD), maximum(most2, up), most2)
    least2 = where(n < broadcast(CROWD_BELOW), minimum(least2, down), least2)
    top, bottom = minimum(most, most2), maximum(least, least2)
    crossed, level = top < bottom, where(most2 < most, most2, least2)  # a lone return far from all others
    top, bottom = where(crossed, level, top), where(crossed, level, bottom)
    enough, alone = broadcast(FEW_RETURNS) < nearby, most2 == broadcast(LOWEST)
    return (
        where(enough, where(alone, top_alone, top), most),
        where(enough, where(alone, bottom_alone, bottom), least),
    )


@kernel_part
def _summarise_lanes(
    held: Row, width: int, south: int, here: int, north: int, out: Row, to: int, layer: int
) -> None:
    """Write the layers of `summarise` for 16 cells, `layer` apart."""
    stray, nothing, one, unknown = broadcast(STRAY), broadcast(F0), broadcast(F1), broadcast(NAN)
    n, height = load(held, here), load(held, here + MEAN_HEIGHT * width)
    most, least = load(held, here + ROW_MAX * width), load(held, here + ROW_MIN * width)
    nearby = _nearby(held, south, here, north)
    top, bottom = _supported(held, width, south, here, north, nearby, most, least)
    high, total = stray < most - top, height * n
    total, left = where(high, total - most, total), where(high, n - one, n)
    low = logical_and(stray < bottom - least, one < left)
    total, left = where(low, total - least, total), where(low, left - one, left)
    height = where(one < n, total / left, minimum(maximum(height, bottom), top))
    now = EPOCH * width
    top_now, bottom_now = _supported(held, width, south + now, here + now, north + now, nearby, top, bottom)
    cut = nothing < where(top < most, one, where(least < bottom, one, nothing))
    top, bottom = where(cut, maximum(top, top_now), top), where(cut, minimum(bottom, bottom_now), bottom)
    seen, spread = nothing < n, load(held, here + MEAN_NOISE * width)
    store(out, to + HEIGHT * layer, where(seen, height, unknown))
    store(out, to + BOTTOM * layer, where(seen, bottom, unknown))
    store(out, to + TOP * layer, where(seen, top, unknown))
    store(out, to + WEIGHT * layer, n)
    store(out, to + SPREAD * layer, where(seen, spread, unknown))
    store(out, to + EXCESS * layer, where(seen, nothing, unknown))
    if flags_of(broadcast(ALONE) < n) != NONE:
        for i in range(LANES):
            count = out[to + WEIGHT * layer + i]
            more = BEYOND_ONE[int(count)] if count < TABLE_LENGTH else expected_maximum(count) - 1
            out[to + EXCESS * layer + i] = more * np.sqrt(out[to + SPREAD * layer + i])


@kernel
def summarise(
    records: Row, places: Array2D[np.int64], first: int, cols: int, now_s: Float32, max_age_s: Float32
) -> Layers:
    """Return height, bottom, top, number of returns, excess and spread of every cell; NaN, 0 where unknown.

    Top is the highest return of the cell, but no higher than its support: a second return that reaches as
    far. Bottom likewise. So one ghost does not make the ground unsafe, and two returns of a pole do. Where
    returns of both epochs are few, a wire or fence may have sent back a single one, so no support is needed;
    the few returns at the beginning of an epoch over ground seen often do need it. Support comes from the
    cell itself or, while the cell has few returns, from its neighbours: with many returns, ghosts in two
    adjacent cells are likely by chance, below the ground with half as many. Older returns must not outvote
    new ones: where support cuts an extreme, top and bottom reach as far as the supported extremes of both
    epochs together or of the current epoch alone. The height is the mean without unsupported extremes. The
    excess is the distance beyond one standard deviation to which noise alone is expected to carry the
    extremes of that many returns; the spread is the variance of that noise.

    Parameters
    ----------
    records
        Evidence of cells, `RECORD` numbers each, in any order of stretches.
    places
        (rows, n) index in `records` of the first cell of each stretch of `TILE` cells; < 0 for none.
    first, cols
        Cells to skip in a row's first stretch, and cells to use. More cells of the stretches are read, in
        whole lanes.
    """
    rows, before = len(places), first % LANES
    # With lanes to the west and to the east in which nothing was seen.
    width = -(-(before + cols) // LANES) * LANES + 2 * LANES
    line, size, west = ROW_LAYERS * width, rows * cols, first - before
    held, row = np.empty(3 * line, np.float32), np.empty(SUMMARY_LAYERS * LANES, np.float32)
    whole = np.empty(SUMMARY_LAYERS * size, np.float32)
    for c in range(0, width, LANES):
        for r in range(3):
            _store_empty(held, r * line + c, width)
    for r in range(rows + 1):
        north, here, south = r % 3 * line, (r + 2) % 3 * line, (r + 1) % 3 * line
        if r < rows:
            _read_row(records, places, r, west, before + cols, now_s, max_age_s, held, north + LANES, width)
        else:
            for c in range(0, width, LANES):
                _store_empty(held, north + c, width)
        if r == 0:
            continue
        for c in range(0, cols, LANES):
            at, to, n = LANES + before + c, (r - 1) * cols + c, min(LANES, cols - c)
            if n == LANES:
                _summarise_lanes(held, width, south + at, here + at, north + at, whole, to, size)
                continue
            _summarise_lanes(held, width, south + at, here + at, north + at, row, 0, LANES)
            for layer in range(SUMMARY_LAYERS):
                for i in range(n):
                    whole[layer * size + to + i] = row[layer * LANES + i]
    return whole.reshape(SUMMARY_LAYERS, rows, cols)


@kernel
def stretches(table: Array2D[np.int32], row0: int, row1: int) -> Array2D[np.int64]:
    """Return `places` of `summarise` for rows of cells of a rectangle of tiles, from their slots."""
    out = np.empty((row1 - row0, table.shape[1]), np.int64)
    for r in range(row0, row1):
        for c in range(table.shape[1]):
            slot = np.int64(table[(r >> TILE_BITS) - (row0 >> TILE_BITS), c])
            out[r - row0, c] = -1 if slot < 0 else (slot * TILE + (r & (TILE - 1))) * TILE
    return out


def summary(evidence: NDArray[np.float32], now_s: float, max_age_s: float) -> Layers:
    """Return `summarise` of (rows, cols, 2, FIELDS) evidence, see `Tiles.read`."""
    rows, cols = evidence.shape[:2]
    wide = -(-cols // LANES) * LANES
    whole = evidence
    if wide > cols:
        whole = np.zeros((rows, wide, *evidence.shape[2:]), np.float32)
        whole[:, :cols] = evidence
    places = np.add.outer(np.arange(rows) * wide, np.arange(0, wide, TILE))
    return summarise(whole.reshape(-1), places, 0, cols, now_s, max_age_s)
