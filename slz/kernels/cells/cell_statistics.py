"""What the returns of a cell and of those around it say of its ground: height, bottom, top and noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.cells.cell_record import (
    BOTTOM,
    COUNT,
    EXCESS,
    FIELDS,
    HEIGHT,
    HIGH,
    HIGH2,
    LAYERS,
    LOW,
    LOW2,
    MEAN,
    NOISE,
    SPREAD,
    TILE,
    TIME,
    TOP,
    WEIGHT,
)
from slz.kernels.jit import kernel
from slz.kernels.raster.bitmap import NONE
from slz.kernels.simd import (
    LANES,
    Floats,
    ask_for,
    both,
    columns,
    every,
    flags_of,
    higher,
    load,
    lower,
    room,
    store,
    where,
)

FEW = np.float32(20)  # returns of 3 x 3 cells up to which each stands for itself
CROWD = np.float32(64)  # returns of a cell from which on its hazards show in more than one of them
STRAY = np.float32(0.5)  # m beyond what is supported, from which on an extreme is left out of the mean

# Layers of a row while it is judged, of both epochs together and then of the current one: number of returns,
# highest, second highest, lowest, second lowest, and how far up and down the neighbours' returns may reach.
COUNTED, MOST, MOST2, LEAST, LEAST2, UP, DOWN = range(7)
EPOCH = 7
MEAN_HEIGHT, MEAN_NOISE = 2 * EPOCH, 2 * EPOCH + 1
HELD = 2 * EPOCH + 2
RECORD = 2 * FIELDS  # numbers of a cell's evidence

F0, F1, NAN = np.float32(0), np.float32(1), np.float32(np.nan)
HIGHEST, LOWEST = np.float32(np.inf), np.float32(-np.inf)
Row = NDArray[np.float32]
Layers = NDArray[np.float32]


@kernel("float64(float64)")
def expected_maximum(n: float) -> float:
    """Return the expected maximum of n > 8 standard normal numbers (its Gumbel limit; 7 % too large at 9)."""
    root = np.sqrt(2 * np.log(n))
    return float(root - (np.log(np.log(n)) + np.log(4 * np.pi) - 2 * 0.5772) / (2 * root))


ALONE = np.float32(8)  # returns, up to which the excess is nothing
MANY = 1024
BEYOND_ONE = np.array([expected_maximum(float(n)) - 1 if n > 8 else 0.0 for n in range(MANY)])


@kernel()
def _hold(
    held: Row, width: int, at: int, n: Floats, most: Floats, most2: Floats, least: Floats, least2: Floats
) -> None:
    nobody, single = n == every(F0), n < every(CROWD)
    store(held, at + COUNTED * width, n)
    store(held, at + MOST * width, most)
    store(held, at + MOST2 * width, most2)
    store(held, at + LEAST * width, least)
    store(held, at + LEAST2 * width, least2)
    store(held, at + UP * width, where(nobody, every(LOWEST), where(single, most, most2)))
    store(held, at + DOWN * width, where(nobody, every(HIGHEST), where(single, least, least2)))


@kernel("void(float32[::1], int64, int64)")
def _nothing(held: Row, at: int, width: int) -> None:
    """Leave 16 cells without a return."""
    for layer in range(HELD):
        store(held, at + layer * width, every(F0))
    for epoch in range(2):
        store(held, at + (epoch * EPOCH + UP) * width, every(LOWEST))
        store(held, at + (epoch * EPOCH + DOWN) * width, every(HIGHEST))


@kernel("void(float32[::1], int64, float32, float32, float32[::1], int64, int64)")
def _read(records: Row, first: int, now_s: float, max_age_s: float, held: Row, at: int, width: int) -> None:
    """Leave the evidence of 16 cells in layers; what is too old is without a return."""
    nothing, one, cell = every(F0), every(F1), columns(records, first)
    old = every(max_age_s) < every(now_s) - cell[FIELDS + TIME]
    n, mean, noise = where(old, nothing, cell[COUNT]), cell[MEAN], cell[NOISE]
    pair, most, least = one < n, cell[HIGH], cell[LOW]
    most2, least2 = where(pair, cell[HIGH2], every(LOWEST)), where(pair, cell[LOW2], every(HIGHEST))
    _hold(held, width, at + EPOCH * width, n, most, most2, least, least2)

    n_then = where(n == nothing, nothing, cell[FIELDS + COUNT])
    also, pair, high, low = nothing < n_then, one < n_then, cell[FIELDS + HIGH], cell[FIELDS + LOW]
    high2, low2 = where(pair, cell[FIELDS + HIGH2], most2), where(pair, cell[FIELDS + LOW2], least2)
    most2 = where(also, higher(lower(most, high), higher(most2, high2)), most2)
    least2 = where(also, lower(higher(least, low), lower(least2, low2)), least2)
    most, least = where(also, higher(most, high), most), where(also, lower(least, low), least)
    _hold(held, width, at, n + n_then, most, most2, least, least2)
    total = n + n_then
    mean_then, noise_then = cell[FIELDS + MEAN], cell[FIELDS + NOISE]
    store(held, at + MEAN_HEIGHT * width, where(also, (mean * n + mean_then * n_then) / total, mean))
    store(held, at + MEAN_NOISE * width, where(also, (noise * n + noise_then * n_then) / total, noise))


@kernel(
    "void(float32[::1], int64[:, ::1], int64, int64, int64, float32, float32, float32[::1], int64, int64)"
)
def _read_row(
    records: Row,
    places: NDArray[np.int64],
    r: int,
    first: int,
    count: int,
    now_s: float,
    max_age_s: float,
    held: Row,
    at: int,
    width: int,
) -> None:
    """Leave the evidence of a row from cell `first` of its first stretch on, in whole lanes.

    While they are read the cells of the next row are asked for: they lie a page and more apart.
    """
    for c in range(first, first + count, LANES):
        stretch, there = c // TILE, RECORD * (c % TILE)
        place, ahead = places[r, stretch], places[min(r + 1, len(places) - 1), stretch]
        if ahead >= 0:
            for k in range(LANES):
                ask_for(records, RECORD * (ahead + k) + there)
        if place < 0:
            _nothing(held, at + c - first, width)
        else:
            _read(records, RECORD * place + there, now_s, max_age_s, held, at + c - first, width)


@kernel()
def _supported(held: Row, width: int, south: int, here: int, north: int) -> tuple[Floats, Floats]:
    """Return how far up and how far down the returns of cells reach, see `summarise`."""
    n, most, least = load(held, here), load(held, here + MOST * width), load(held, here + LEAST * width)
    most2, least2 = load(held, here + MOST2 * width), load(held, here + LEAST2 * width)
    nearby, up, down = n, every(LOWEST), every(HIGHEST)
    for row in (south, here, north):
        for at in range(row - 1, row + 2):
            if at != here:
                nearby = nearby + load(held, at)
                up = higher(up, load(held, at + UP * width))
                down = lower(down, load(held, at + DOWN * width))
    single = n < every(CROWD)
    most2 = where(single, higher(most2, up), most2)
    least2 = where(single, lower(least2, down), least2)
    top, bottom = lower(most, most2), higher(least, least2)
    crossed, level = top < bottom, where(most2 < most, most2, least2)  # a lone return far from all around it
    top, bottom = where(crossed, level, top), where(crossed, level, bottom)
    enough, alone = every(FEW) < nearby, most2 == every(LOWEST)
    return (
        where(alone, most, where(enough, top, most)),
        where(alone, least, where(enough, bottom, least)),
    )


@kernel("void(float32[::1], int64, int64, int64, int64, float32[::1], int64, int64)")
def _judge(held: Row, width: int, south: int, here: int, north: int, out: Row, to: int, layer: int) -> None:
    """Leave the layers of `summarise` of 16 cells, so far apart."""
    stray, nothing, one, unknown = every(STRAY), every(F0), every(F1), every(NAN)
    n, height = load(held, here), load(held, here + MEAN_HEIGHT * width)
    most, least = load(held, here + MOST * width), load(held, here + LEAST * width)
    top, bottom = _supported(held, width, south, here, north)
    high, total = stray < most - top, height * n
    total, left = where(high, total - most, total), where(high, n - one, n)
    low = both(stray < bottom - least, one < left)
    total, left = where(low, total - least, total), where(low, left - one, left)
    height = where(one < n, total / left, lower(higher(height, bottom), top))
    now = EPOCH * width
    top_now, bottom_now = _supported(held, width, south + now, here + now, north + now)
    cut = nothing < where(top < most, one, where(least < bottom, one, nothing))
    top, bottom = where(cut, higher(top, top_now), top), where(cut, lower(bottom, bottom_now), bottom)
    seen, spread = nothing < n, load(held, here + MEAN_NOISE * width)
    store(out, to + HEIGHT * layer, where(seen, height, unknown))
    store(out, to + BOTTOM * layer, where(seen, bottom, unknown))
    store(out, to + TOP * layer, where(seen, top, unknown))
    store(out, to + WEIGHT * layer, n)
    store(out, to + SPREAD * layer, where(seen, spread, unknown))
    store(out, to + EXCESS * layer, where(seen, nothing, unknown))
    if flags_of(every(ALONE) < n) != NONE:
        for i in range(LANES):
            count = out[to + WEIGHT * layer + i]
            more = BEYOND_ONE[int(count)] if count < MANY else expected_maximum(count) - 1
            out[to + EXCESS * layer + i] = more * np.sqrt(out[to + SPREAD * layer + i])


@kernel("float32[:, :, ::1](float32[::1], int64[:, ::1], int64, int64, float32, float32)")
def summarise(
    records: Row, places: NDArray[np.int64], first: int, cols: int, now_s: float, max_age_s: float
) -> Layers:
    """Return height, bottom, top, number of returns, excess and spread of every cell; NaN, 0 where unknown.

    Top is the highest return of the cell, but only as far up as a second return reaches; bottom likewise. So
    one ghost cannot condemn the ground, two returns of a pole do. Where returns are few, a wire or fence may
    have sent back one only, and each stands for itself. The second is one of the cell, or while
    the cell has few returns, one of the cells around: of many, two ghosts in neighbours are mere chance. What
    has come since the ground was seen before must not be outvoted by the returns from then: top and bottom
    are as far as those of both epochs together reach, or those of the current ones alone. The
    height is the mean without an extreme that found no such support. The excess is how far beyond one
    standard deviation the sensor's noise alone is expected to carry the highest and the lowest return of so
    many; the spread is the variance of that noise.

    Parameters
    ----------
    records
        Evidence of cells, `RECORD` numbers each, wherever they are.
    places
        (rows, n) cell of `records` with which each stretch of `TILE` cells begins; < 0 where there is none.
    first, cols
        Cells to leave out of a row's first stretch, and how many to take then. Beside them there are others,
        so that they lie in whole lanes of their stretches.
    """
    rows, before = len(places), first % LANES
    # With lanes to the west and to the east in which nothing was seen.
    width = -(-(before + cols) // LANES) * LANES + 2 * LANES
    line, size, west = HELD * width, rows * cols, first - before
    held, row, whole = room(3 * line), room(LAYERS * LANES), np.empty(LAYERS * size, np.float32)
    for c in range(0, width, LANES):
        for r in range(3):
            _nothing(held, r * line + c, width)
    for r in range(rows + 1):
        north, here, south = r % 3 * line, (r + 2) % 3 * line, (r + 1) % 3 * line
        if r < rows:
            _read_row(records, places, r, west, before + cols, now_s, max_age_s, held, north + LANES, width)
        else:
            for c in range(0, width, LANES):
                _nothing(held, north + c, width)
        if r == 0:
            continue
        for c in range(0, cols, LANES):
            at, to, n = LANES + before + c, (r - 1) * cols + c, min(LANES, cols - c)
            if n == LANES:
                _judge(held, width, south + at, here + at, north + at, whole, to, size)
                continue
            _judge(held, width, south + at, here + at, north + at, row, 0, LANES)
            for layer in range(LAYERS):
                for i in range(n):
                    whole[layer * size + to + i] = row[layer * LANES + i]
    return whole.reshape(LAYERS, rows, cols)


def summary(evidence: NDArray[np.float32], now_s: float, max_age_s: float) -> Layers:
    """Return what `summarise` does of (rows, cols, 2, FIELDS) evidence, see `Tiles.read`."""
    rows, cols = evidence.shape[:2]
    wide = -(-cols // LANES) * LANES
    whole = evidence
    if wide > cols:
        whole = np.zeros((rows, wide, *evidence.shape[2:]), np.float32)
        whole[:, :cols] = evidence
    places = np.add.outer(np.arange(rows) * wide, np.arange(0, wide, TILE))
    return summarise(whole.reshape(-1), places, 0, cols, now_s, max_age_s)
