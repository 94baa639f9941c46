"""Sums over the footprints of a patch: 16 columns of them, and a few rows.

All is by lanes and in single precision: heights are over one near by, places count in cells from a cell near
by. A sum is added up anew for every patch and nothing is ever taken away from it again, so it depends on the
cells of its footprint alone, and on which of them are in the patch's first and last rows.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel
from slz.kernels.lanes import LANES, every, load, multiplied, store

# Layers of a patch's cells: 1 where known, height over the patch's level, 1 / number of returns, variance of
# the noise, all 0 where unknown; lowest and highest ground, infinite where unknown.
KNOWN, RISE, INVERSE, NOISE, LOWER, UPPER = range(6)
HELD = 6

# Layers of sums over the rows of footprints: of KNOWN times 1, y, y², of RISE times 1, y, RISE, of INVERSE
# and of NOISE.
SUMS = 8
F0 = np.float32(0)

Row = NDArray[np.float32]
Sums = Any  # as many lanes as there are sums


@kernel()
def _with_row(held: Row, at: int, layer: int, y: float, s: Sums) -> Sums:
    """Return sums with one more row of cells."""
    north, known, rise = every(np.float32(y)), load(held, at), load(held, at + RISE * layer)
    known_north = known * north
    return (
        s[0] + known,
        s[1] + known_north,
        multiplied(known_north, north, s[2]),
        s[3] + rise,
        multiplied(rise, north, s[4]),
        multiplied(rise, rise, s[5]),
        s[6] + load(held, at + INVERSE * layer),
        s[7] + load(held, at + NOISE * layer),
    )


@kernel("void(float32[::1], int64, int64, int64, float32[::1])")
def over_rows(held: Row, rows: int, radius: int, wide: int, sums: Row) -> None:
    """Leave the sums over the rows of footprints, column by column.

    Parameters
    ----------
    held
        Layers of rows + 2 radius rows of cells, `wide` each.
    rows
        Of footprints, no more than a footprint has; y counts from the row of cells number rows / 2 + radius.
    sums
        `SUMS` layers of so many rows.
    """
    layer, out, side, middle = (rows + 2 * radius) * wide, rows * wide, 2 * radius + 1, rows // 2 + radius
    for c in range(0, wide, LANES):
        none = every(F0)
        s = none, none, none, none, none, none, none, none
        for i in range(rows - 1, side):  # what all have
            s = _with_row(held, i * wide + c, layer, i - middle, s)
        for j in range(rows - 1, -1, -1):  # and to the south
            if j < rows - 1:
                s = _with_row(held, j * wide + c, layer, j - middle, s)
            at = j * wide + c
            store(sums, at, s[0])
            store(sums, at + out, s[1])
            store(sums, at + 2 * out, s[2])
            store(sums, at + 3 * out, s[3])
            store(sums, at + 4 * out, s[4])
            store(sums, at + 5 * out, s[5])
            store(sums, at + 6 * out, s[6])
            store(sums, at + 7 * out, s[7])
        s = none, none, none, none, none, none, none, none
        for j in range(1, rows):  # and to the north
            i, at = side + j - 1, j * wide + c
            s = _with_row(held, i * wide + c, layer, i - middle, s)
            store(sums, at, load(sums, at) + s[0])
            store(sums, at + out, load(sums, at + out) + s[1])
            store(sums, at + 2 * out, load(sums, at + 2 * out) + s[2])
            store(sums, at + 3 * out, load(sums, at + 3 * out) + s[3])
            store(sums, at + 4 * out, load(sums, at + 4 * out) + s[4])
            store(sums, at + 5 * out, load(sums, at + 5 * out) + s[5])
            store(sums, at + 6 * out, load(sums, at + 6 * out) + s[6])
            store(sums, at + 7 * out, load(sums, at + 7 * out) + s[7])


# Sums over footprints, by their place in what `over_columns` returns.
W, WX, WXX, WY, WXY, WYY, WZ, WXZ, WYZ, WZZ, S_INVERSE, S_NOISE = range(12)


@kernel()
def over_columns(sums: Row, at: int, layer: int, away: Row, y: float) -> Sums:
    """Return the sums over 16 footprints, x and y counted from the middle of each.

    Parameters
    ----------
    sums
        As `over_rows` leaves them.
    at
        Where the row of footprints begins.
    away
        How far the columns of a footprint are to the east of its middle, in cells.
    y
        Of that row, as `over_rows` counts.
    """
    radius = len(away) // 2
    k, yk, yyk, z = at + radius, at + radius + layer, at + radius + 2 * layer, at + radius + 3 * layer
    yz, zz, inverse, noise = z + layer, z + 2 * layer, z + 3 * layer, z + 4 * layer
    w, wx, wxx = load(sums, k), every(F0), every(F0)
    wy, wxy, wyy = load(sums, yk), every(F0), load(sums, yyk)
    wz, wxz, wyz, wzz = load(sums, z), every(F0), load(sums, yz), load(sums, zz)
    inverses, noises = load(sums, inverse), load(sums, noise)
    for d in range(1, radius + 1):
        x = every(away[radius + d])
        east, west = load(sums, k + d), load(sums, k - d)
        both, more = east + west, (east - west) * x
        w, wx, wxx = w + both, wx + more, multiplied(both, x * x, wxx)
        east, west = load(sums, yk + d), load(sums, yk - d)
        wy, wxy = wy + (east + west), multiplied(east - west, x, wxy)
        east, west = load(sums, z + d), load(sums, z - d)
        wz, wxz = wz + (east + west), multiplied(east - west, x, wxz)
        wyy = wyy + (load(sums, yyk + d) + load(sums, yyk - d))
        wyz = wyz + (load(sums, yz + d) + load(sums, yz - d))
        wzz = wzz + (load(sums, zz + d) + load(sums, zz - d))
        inverses = inverses + (load(sums, inverse + d) + load(sums, inverse - d))
        noises = noises + (load(sums, noise + d) + load(sums, noise - d))
    north = every(np.float32(y))
    wyy = wyy - north * (wy + wy - north * w)
    return w, wx, wxx, wy - north * w, wxy - north * wx, wyy, wz, wxz, wyz - north * wz, wzz, inverses, noises
