"""Sums over the footprints of a patch: 32 columns of them, and a few rows.

All is by lanes. Places count in cells from a cell near by, so that what is summed of them is exact in single
precision; heights are over one near by and are summed in double precision, since their squares nearly cancel
out on a roof beside the street. A sum is added up anew for every patch and nothing is ever taken away from it
again, so it depends on the cells of its footprint alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slz.kernels.jit import kernel
from slz.kernels.simd import (
    LANES,
    Doubles,
    every,
    every_wide,
    load,
    load_wide,
    multiplied,
    store,
    store_wide,
    widened,
)

# Layers of a patch's cells: 1 where known, height over the patch's level, 1 / number of returns, variance of
# the noise, all 0 where unknown; lowest and highest ground, infinite where unknown.
KNOWN, RISE, INVERSE, NOISE, LOWER, UPPER = range(6)
HELD = 6

# Layers of sums over the rows of footprints: of KNOWN times 1, y, y², of INVERSE and of NOISE; and, in double
# precision, of RISE times 1, y and RISE.
SUMS, RISES = 5, 3
F0, D0 = np.float32(0), np.float64(0)

Row = NDArray[np.float32]
Wide = NDArray[np.float64]
Sums = Any  # as many lanes as there are sums


@kernel()
def _with_row(held: Row, at: int, layer: int, y: float, s: Sums) -> Sums:
    """Return sums with one more row of cells."""
    north, known = every(np.float32(y)), load(held, at)
    known_north = known * north
    return (
        s[0] + known,
        s[1] + known_north,
        multiplied(known_north, north, s[2]),
        s[3] + load(held, at + INVERSE * layer),
        s[4] + load(held, at + NOISE * layer),
    )


@kernel()
def _with_rises(held: Row, at: int, layer: int, y: float, s: Sums) -> Sums:
    """Return sums of heights with one more row of cells."""
    rise = widened(load(held, at + RISE * layer))
    return s[0] + rise, s[1] + rise * every_wide(y), s[2] + rise * rise


@kernel()
def _keep(sums: Row, rises: Wide, at: int, layer: int, s: Sums, z: Sums) -> None:
    store(sums, at, s[0])
    store(sums, at + layer, s[1])
    store(sums, at + 2 * layer, s[2])
    store(sums, at + 3 * layer, s[3])
    store(sums, at + 4 * layer, s[4])
    store_wide(rises, at, z[0])
    store_wide(rises, at + layer, z[1])
    store_wide(rises, at + 2 * layer, z[2])


@kernel("void(float32[::1], int64, int64, int64, float32[::1], float64[::1])")
def over_rows(held: Row, rows: int, radius: int, wide: int, sums: Row, rises: Wide) -> None:
    """Leave the sums over the rows of footprints, column by column.

    Parameters
    ----------
    held
        Layers of rows + 2 radius rows of cells, `wide` each.
    rows
        Of footprints, no more than a footprint has; y counts from the row of cells number rows / 2 + radius.
    sums, rises
        `SUMS` and `RISES` layers of so many rows.
    """
    layer, out, side, middle = (rows + 2 * radius) * wide, rows * wide, 2 * radius + 1, rows // 2 + radius
    none, nothing = every(F0), every_wide(D0)
    for c in range(0, wide, LANES):
        s, z = (none, none, none, none, none), (nothing, nothing, nothing)
        for i in range(rows - 1, side):  # what all have
            s = _with_row(held, i * wide + c, layer, i - middle, s)
            z = _with_rises(held, i * wide + c, layer, float(i - middle), z)
        for j in range(rows - 1, -1, -1):  # and to the south
            if j < rows - 1:
                s = _with_row(held, j * wide + c, layer, j - middle, s)
                z = _with_rises(held, j * wide + c, layer, float(j - middle), z)
            _keep(sums, rises, j * wide + c, out, s, z)
        s, z = (none, none, none, none, none), (nothing, nothing, nothing)
        for j in range(1, rows):  # and to the north
            i, at = side + j - 1, j * wide + c
            s = _with_row(held, i * wide + c, layer, i - middle, s)
            z = _with_rises(held, i * wide + c, layer, float(i - middle), z)
            whole = (
                load(sums, at) + s[0],
                load(sums, at + out) + s[1],
                load(sums, at + 2 * out) + s[2],
                load(sums, at + 3 * out) + s[3],
                load(sums, at + 4 * out) + s[4],
            )
            heights = (
                load_wide(rises, at) + z[0],
                load_wide(rises, at + out) + z[1],
                load_wide(rises, at + 2 * out) + z[2],
            )
            _keep(sums, rises, at, out, whole, heights)


# Sums over footprints, by their place in what `over_columns` returns, and in what `rises_over_columns` does.
W, WX, WXX, WY, WXY, WYY, S_INVERSE, S_NOISE = range(8)
WZ, WXZ, WYZ, WZZ = range(4)


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
    k, yk, yyk = at + radius, at + radius + layer, at + radius + 2 * layer
    inverse, noise = at + radius + 3 * layer, at + radius + 4 * layer
    w, wx, wxx = load(sums, k), every(F0), every(F0)
    wy, wxy, wyy = load(sums, yk), every(F0), load(sums, yyk)
    inverses, noises = load(sums, inverse), load(sums, noise)
    for d in range(1, radius + 1):
        x = every(away[radius + d])
        east, west = load(sums, k + d), load(sums, k - d)
        both, more = east + west, (east - west) * x
        w, wx, wxx = w + both, wx + more, multiplied(both, x * x, wxx)
        east, west = load(sums, yk + d), load(sums, yk - d)
        wy, wxy = wy + (east + west), multiplied(east - west, x, wxy)
        wyy = wyy + (load(sums, yyk + d) + load(sums, yyk - d))
        inverses = inverses + (load(sums, inverse + d) + load(sums, inverse - d))
        noises = noises + (load(sums, noise + d) + load(sums, noise - d))
    north = every(np.float32(y))
    wyy = wyy - north * (wy + wy - north * w)
    return w, wx, wxx, wy - north * w, wxy - north * wx, wyy, inverses, noises


@kernel()
def rises_over_columns(rises: Wide, at: int, layer: int, away: Row, y: float) -> tuple[Doubles, ...]:
    """Return the sums of heights over 16 footprints, see `over_columns`."""
    radius = len(away) // 2
    z, yz, zz = at + radius, at + radius + layer, at + radius + 2 * layer
    wz, wxz, wyz, wzz = load_wide(rises, z), every_wide(D0), load_wide(rises, yz), load_wide(rises, zz)
    for d in range(1, radius + 1):
        east, west = load_wide(rises, z + d), load_wide(rises, z - d)
        wz, wxz = wz + (east + west), wxz + (east - west) * every_wide(away[radius + d])
        wyz = wyz + (load_wide(rises, yz + d) + load_wide(rises, yz - d))
        wzz = wzz + (load_wide(rises, zz + d) + load_wide(rises, zz - d))
    return wz, wxz, wyz - every_wide(y) * wz, wzz
