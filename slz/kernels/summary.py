"""What the returns of a cell and of those around it say of its ground: height, bottom, top and noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel
from slz.kernels.lanes import LANES, Floats, both, columns, every, load, store, where
from slz.kernels.record import (
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


MANY = 1024
BEYOND_ONE = np.array([expected_maximum(float(n)) - 1 if n > 8 else 0.0 for n in range(MANY)])


@kernel()
def _lower(a: Floats, b: Floats) -> Floats:
    return where(b < a, b, a)


@kernel()
def _higher(a: Floats, b: Floats) -> Floats:
    return where(a < b, b, a)


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


@kernel("void(float32[::1], int64, float32, float32, float32[::1], int64, int64)")
def _read(cells: Row, count: int, now_s: float, max_age_s: float, held: Row, at: int, width: int) -> None:
    """Leave the evidence of a row in layers; what is too old is without a return."""
    nothing, one = every(F0), every(F1)
    for c in range(0, count, LANES):
        cell = columns(cells, RECORD * c)
        old = every(max_age_s) < every(now_s) - cell[FIELDS + TIME]
        n, mean, noise = where(old, nothing, cell[COUNT]), cell[MEAN], cell[NOISE]
        pair, most, least = one < n, cell[HIGH], cell[LOW]
        most2, least2 = where(pair, cell[HIGH2], every(LOWEST)), where(pair, cell[LOW2], every(HIGHEST))
        _hold(held, width, at + EPOCH * width + c, n, most, most2, least, least2)

        n_then = where(n == nothing, nothing, cell[FIELDS + COUNT])
        also, pair, high, low = nothing < n_then, one < n_then, cell[FIELDS + HIGH], cell[FIELDS + LOW]
        high2, low2 = where(pair, cell[FIELDS + HIGH2], most2), where(pair, cell[FIELDS + LOW2], least2)
        most2 = where(also, _higher(_lower(most, high), _higher(most2, high2)), most2)
        least2 = where(also, _lower(_higher(least, low), _lower(least2, low2)), least2)
        most, least = where(also, _higher(most, high), most), where(also, _lower(least, low), least)
        _hold(held, width, at + c, n + n_then, most, most2, least, least2)
        total = n + n_then
        mean_then, noise_then = cell[FIELDS + MEAN], cell[FIELDS + NOISE]
        store(held, at + MEAN_HEIGHT * width + c, where(also, (mean * n + mean_then * n_then) / total, mean))
        store(
            held, at + MEAN_NOISE * width + c, where(also, (noise * n + noise_then * n_then) / total, noise)
        )


@kernel("void(float32[::1], int64, int64)")
def _blank(held: Row, at: int, width: int) -> None:
    """Leave a row without a return."""
    held[at : at + HELD * width] = 0
    for epoch in range(2):
        first = at + epoch * EPOCH * width
        held[first + UP * width : first + (UP + 1) * width] = LOWEST
        held[first + DOWN * width : first + (DOWN + 1) * width] = HIGHEST


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
                up = _higher(up, load(held, at + UP * width))
                down = _lower(down, load(held, at + DOWN * width))
    single = n < every(CROWD)
    most2 = where(single, _higher(most2, up), most2)
    least2 = where(single, _lower(least2, down), least2)
    top, bottom = _lower(most, most2), _higher(least, least2)
    crossed, level = top < bottom, where(most2 < most, most2, least2)  # a lone return far from all around it
    top, bottom = where(crossed, level, top), where(crossed, level, bottom)
    enough, alone = every(FEW) < nearby, most2 == every(LOWEST)
    return (
        where(alone, most, where(enough, top, most)),
        where(alone, least, where(enough, bottom, least)),
    )


@kernel("void(float32[::1], int64, int64, int64, int64, int64, float32[::1])")
def _judge(held: Row, width: int, south: int, here: int, north: int, count: int, out: Row) -> None:
    """Leave the layers of `summarise` of a row, but for the excess."""
    stray, nothing, one, unknown = every(STRAY), every(F0), every(F1), every(NAN)
    for c in range(0, count, LANES):
        at = here + c
        n, height = load(held, at), load(held, at + MEAN_HEIGHT * width)
        most, least = load(held, at + MOST * width), load(held, at + LEAST * width)
        top, bottom = _supported(held, width, south + c, at, north + c)
        high, total = stray < most - top, height * n
        total, left = where(high, total - most, total), where(high, n - one, n)
        low = both(stray < bottom - least, one < left)
        total, left = where(low, total - least, total), where(low, left - one, left)
        height = where(one < n, total / left, _lower(_higher(height, bottom), top))
        c_now = EPOCH * width + c
        top_now, bottom_now = _supported(held, width, south + c_now, here + c_now, north + c_now)
        cut = nothing < where(top < most, one, where(least < bottom, one, nothing))
        top, bottom = where(cut, _higher(top, top_now), top), where(cut, _lower(bottom, bottom_now), bottom)
        seen = nothing < n
        store(out, HEIGHT * width + c, where(seen, height, unknown))
        store(out, BOTTOM * width + c, where(seen, bottom, unknown))
        store(out, TOP * width + c, where(seen, top, unknown))
        store(out, WEIGHT * width + c, n)
        store(out, SPREAD * width + c, where(seen, load(held, at + MEAN_NOISE * width), unknown))


@kernel("void(float32[::1], float32[::1], float32[::1])")
def _exceed(weight: Row, spread: Row, out: Row) -> None:
    for c in range(np.uint64(len(out))):
        n = weight[c]
        more = BEYOND_ONE[int(n)] if n < MANY else expected_maximum(n) - 1
        out[c] = more * np.sqrt(spread[c])


@kernel("void(float32[::1], int64, float32, float32, float32[::1], float32[::1], float32[:, :, ::1])")
def _advance(cells: Row, r: int, now_s: float, max_age_s: float, held: Row, row: Row, out: Layers) -> None:
    """Take row r of the evidence, one past the last for none, and judge the row to its south.

    Parameters
    ----------
    held
        The last three rows taken, each in `HELD` layers of so many cells as `row` has.
    """
    rows, cols, width = out.shape[1], out.shape[2], len(row) // LAYERS
    line = HELD * width
    north, here, south = r % 3 * line, (r + 2) % 3 * line, (r + 1) % 3 * line
    if r < rows:
        _read(cells, cols, now_s, max_age_s, held, north + 1, width)
    else:
        _blank(held, north, width)
    if r == 0:
        _blank(held, here, width)
        return
    _judge(held, width, south + 1, here + 1, north + 1, cols, row)
    for layer in range(LAYERS):
        out[layer, r - 1] = row[layer * width : layer * width + cols]
    _exceed(out[WEIGHT, r - 1], out[SPREAD, r - 1], out[EXCESS, r - 1])


@kernel("Tuple((float32[::1], float32[::1], float32[::1], float32[:, :, ::1]))(int64, int64)")
def _room(rows: int, cols: int) -> tuple[Row, Row, Row, Layers]:
    """Return cells of a row, three rows held, one judged (each with nothing to its west and east), layers."""
    width = -(-cols // LANES) * LANES + 2
    held = np.empty(3 * HELD * width, np.float32)
    for r in range(3):
        _blank(held, r * HELD * width, width)
    row, cells = np.empty(LAYERS * width, np.float32), np.zeros(RECORD * width, np.float32)
    return cells, held, row, np.empty((LAYERS, rows, cols), np.float32)


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
        Cells to leave out of a row's first stretch, and how many to take then.
    """
    rows = len(places)
    cells, held, row, out = _room(rows, cols)
    for r in range(rows + 1):
        if r < rows:
            c = 0
            for s in range(places.shape[1]):
                skipped = first if s == 0 else 0
                at, many = RECORD * (places[r, s] + skipped), min(TILE - skipped, cols - c)
                for k in range(0, RECORD * many, LANES):
                    store(cells, RECORD * c + k, load(records, at + k) if places[r, s] >= 0 else every(F0))
                c += many
        _advance(cells, r, now_s, max_age_s, held, row, out)
    return out


def summary(evidence: NDArray[np.float32], now_s: float, max_age_s: float) -> Layers:
    """Return what `summarise` does of (rows, cols, 2, FIELDS) evidence, see `slz.tiles.Tiles.read`."""
    rows, cols = evidence.shape[:2]
    places = np.add.outer(np.arange(rows) * cols, np.arange(0, cols, TILE))
    return summarise(evidence.reshape(-1), places, 0, cols, now_s, max_age_s)
