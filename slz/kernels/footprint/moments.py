"""Moments of footprints: sums over the cells of each footprint of a patch, 32 columns by a few rows.

All sums are vectorised. Positions are in cells from a nearby cell, so their sums are exact in single
precision. Heights are relative to a nearby height and summed in double precision, since their squares nearly
cancel out on a roof beside the street. Sums are added up anew for every patch, never by subtraction, so a sum
depends on the cells of its footprint alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from slz.kernels.argument_types import Array1D
from slz.kernels.jit import kernel_for_any_types, kernel_part
from slz.kernels.simd import (
    LANES,
    Doubles,
    broadcast,
    broadcast_wide,
    fused_multiply_add,
    load,
    load_wide,
    store,
    store_wide,
    widened,
)

# Layers of a patch's cells: 1 where known, height over the patch's level, 1 / number of returns, variance of
# the noise, all 0 where unknown; lowest and highest ground, +inf and -inf where unknown.
KNOWN, RISE, INVERSE, RETURN_NOISE, LOWER, UPPER = range(6)
PATCH_LAYERS = 6

# Layers of sums over the rows of footprints: KNOWN times 1, y, y², INVERSE, RETURN_NOISE; and, in double
# precision, RISE times 1, y and RISE.
SUMS, RISES = 5, 3
F0, D0 = np.float32(0), np.float64(0)

Row = Array1D[np.float32]
Wide = Array1D[np.float64]
Sums = Any  # a tuple of lanes, one for each sum
# Sums over footprints, by their index in the result of `over_columns` and of `rises_over_columns`.
W, WX, WXX, WY, WXY, WYY, S_INVERSE, S_NOISE = range(8)
WZ, WXZ, WYZ, WZZ = range(4)


@kernel_for_any_types
def _add_row(held: Row, at: int, layer: int, y: int, s: Sums, z: Sums) -> tuple[Sums, Sums]:
    """Return the sums, and those of heights, with one more row of cells added."""
    north, known, rise = broadcast(np.float32(y)), load(held, at), widened(load(held, at + RISE * layer))
    known_north = known * north
    sums = (
        s[0] + known,
        s[1] + known_north,
        fused_multiply_add(known_north, north, s[2]),
        s[3] + load(held, at + INVERSE * layer),
        s[4] + load(held, at + RETURN_NOISE * layer),
    )
    return sums, (z[0] + rise, z[1] + rise * broadcast_wide(float(y)), z[2] + rise * rise)


@kernel_for_any_types
def _store_sums(sums: Row, rises: Wide, at: int, layer: int, s: Sums, z: Sums) -> None:
    store(sums, at, s[0])
    store(sums, at + layer, s[1])
    store(sums, at + 2 * layer, s[2])
    store(sums, at + 3 * layer, s[3])
    store(sums, at + 4 * layer, s[4])
    store_wide(rises, at, z[0])
    store_wide(rises, at + layer, z[1])
    store_wide(rises, at + 2 * layer, z[2])


@kernel_part
def over_rows(held: Row, rows: int, radius: int, wide: int, sums: Row, rises: Wide) -> None:
    """Write the sums over the rows of footprints, column by column.

    Parameters
    ----------
    held
        Layers of rows + 2 radius rows of cells, `wide` each.
    rows
        Rows of footprints, at most the rows of one footprint; y = 0 at the row of cells rows / 2 + radius.
    sums, rises
        Receive `SUMS` and `RISES` layers of `rows` rows.
    """
    layer, out, side, middle = (rows + 2 * radius) * wide, rows * wide, 2 * radius + 1, rows // 2 + radius
    none, nothing = broadcast(F0), broadcast_wide(D0)
    for c in range(0, wide, LANES):
        s, z = (none, none, none, none, none), (nothing, nothing, nothing)
        for i in range(rows - 1, side):  # rows of cells common to all footprints
            s, z = _add_row(held, i * wide + c, layer, i - middle, s, z)
        for j in range(rows - 1, -1, -1):  # further rows of cells to the south
            if j < rows - 1:
                s, z = _add_row(held, j * wide + c, layer, j - middle, s, z)
            _store_sums(sums, rises, j * wide + c, out, s, z)
        s, z = (none, none, none, none, none), (nothing, nothing, nothing)
        for j in range(1, rows):  # further rows of cells to the north
            i, at = side + j - 1, j * wide + c
            s, z = _add_row(held, i * wide + c, layer, i - middle, s, z)
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
            _store_sums(sums, rises, at, out, whole, heights)


@kernel_for_any_types
def over_columns(sums: Row, at: int, layer: int, away: Row, y: float) -> Sums:
    """Return the sums over 16 footprints, x and y relative to the middle of each.

    Parameters
    ----------
    sums
        As written by `over_rows`.
    at
        Index of the first footprint's westernmost column in its row.
    away
        East offsets of the columns of a footprint from its middle, in cells.
    y
        y of the middle row of the footprints, in the coordinates of `over_rows`.
    """
    radius = len(away) // 2
    k, yk, yyk = at + radius, at + radius + layer, at + radius + 2 * layer
    inverse, noise = at + radius + 3 * layer, at + radius + 4 * layer
    w, wx, wxx = load(sums, k), broadcast(F0), broadcast(F0)
    wy, wxy, wyy = load(sums, yk), broadcast(F0), load(sums, yyk)
    inverses, noises = load(sums, inverse), load(sums, noise)
    for d in range(1, radius + 1):
        x = broadcast(away[radius + d])
        east, west = load(sums, k + d), load(sums, k - d)
        both, more = east + west, (east - west) * x
        w, wx, wxx = w + both, wx + more, fused_multiply_add(both, x * x, wxx)
        east, west = load(sums, yk + d), load(sums, yk - d)
        wy, wxy = wy + (east + west), fused_multiply_add(east - west, x, wxy)
        wyy = wyy + (load(sums, yyk + d) + load(sums, yyk - d))
        inverses = inverses + (load(sums, inverse + d) + load(sums, inverse - d))
        noises = noises + (load(sums, noise + d) + load(sums, noise - d))
    north = broadcast(np.float32(y))
    wyy = wyy - north * (wy + wy - north * w)
    return w, wx, wxx, wy - north * w, wxy - north * wx, wyy, inverses, noises


@kernel_for_any_types
def rises_over_columns(rises: Wide, at: int, layer: int, away: Row, y: float) -> tuple[Doubles, ...]:
    """Return the sums of heights over 16 footprints, see `over_columns`."""
    radius = len(away) // 2
    z, yz, zz = at + radius, at + radius + layer, at + radius + 2 * layer
    wz, wxz, wyz, wzz = load_wide(rises, z), broadcast_wide(D0), load_wide(rises, yz), load_wide(rises, zz)
    for d in range(1, radius + 1):
        east, west = load_wide(rises, z + d), load_wide(rises, z - d)
        wz, wxz = wz + (east + west), wxz + (east - west) * broadcast_wide(away[radius + d])
        wyz = wyz + (load_wide(rises, yz + d) + load_wide(rises, yz - d))
        wzz = wzz + (load_wide(rises, zz + d) + load_wide(rises, zz - d))
    return wz, wxz, wyz - broadcast_wide(y) * wz, wzz
