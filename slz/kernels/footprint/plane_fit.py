"""Least-squares plane, slope and relief of footprints, sixteen at a time."""

from __future__ import annotations

from typing import Any

import numpy as np

from slz.kernels.argument_types import Array1D, Float32
from slz.kernels.elementary_functions import arctangent
from slz.kernels.footprint.moments import (
    S_INVERSE,
    S_NOISE,
    SUMS,
    WX,
    WXX,
    WXY,
    WXZ,
    WY,
    WYY,
    WYZ,
    WZ,
    WZZ,
    W,
    over_columns,
    rises_over_columns,
)
from slz.kernels.jit import kernel_for_any_types, kernel_part
from slz.kernels.raster.bitmap import NONE
from slz.kernels.simd import (
    LANES,
    Floats,
    broadcast,
    broadcast_wide,
    flags,
    flags_of,
    fused_multiply_add,
    load,
    logical_and,
    maximum,
    minimum,
    narrowed,
    sqrt,
    store,
    where,
    widened,
)

HIGHEST, LOWEST = np.float32(np.inf), np.float32(-np.inf)
Row = Array1D[np.float32]
Pair = Any  # of lanes
SIGMAS = np.float32(2.5)  # standard errors between a safe slope and its limit
LEAST_CELLS = np.float32(5.5)  # a plane needs more cells than this
MANY = np.float32(1.5)  # sum of the squared residuals over the squared relief: more than one cell stands out
THIN = np.float32(1e-5)  # least determinant of the scatter matrix over its squared trace: not collinear
# Statistics of a footprint's plane, 16 lanes each: slope and its standard error (deg); relief (m), the
# peak-to-peak of tops and bottoms about the plane, less their excess; rms residual of the heights (m);
# variance of one return (m²); share of the cells with a return; relief without a lone extreme (m).
SLOPE, SIGMA, RELIEF, RMS, NOISE2, SHARE, INNER = range(7)
PLANE_STATISTICS = 7
WEST, NORTH, LEVEL = range(3)  # rise of a plane per cell to the west, to the north; middle height (m)
PLANE = 3
D2 = np.float64(2)
F0, F1, HALF, F3, NAN = (np.float32(value) for value in (0, 1, 0.5, 3, np.nan))
DEGREES = np.float32(57.29577951308232)
Wide = Array1D[np.float64]
# Size of a cell (m), noise of a return (m), limits of slope (deg) and relief (m), of hazards' sides (m).
Limits = tuple[Float32, Float32, Float32, Float32, Float32]


@kernel_for_any_types
def _of_row(lower: Row, upper: Row, at: int, away: Row, first: int, stop: int, west: Floats) -> Pair:
    """Return the lowest and highest of cells of a row, less the eastward rise of the plane."""
    low, high = broadcast(HIGHEST), broadcast(LOWEST)
    for d in range(first, stop):
        far = broadcast(away[d])
        low = minimum(fused_multiply_add(west, far, load(lower, at + d)), low)
        high = maximum(fused_multiply_add(west, far, load(upper, at + d)), high)
    return low, high


@kernel_for_any_types
def relief_without_one(
    lower: Row, upper: Row, at: int, wide: int, away: Row, west: Floats, north: Floats, level: Floats
) -> Floats:
    """Return the relief of 16 footprints about their planes, less a lone extreme; see `reliefs`."""
    side, lowest, highest = len(away), broadcast(HIGHEST), broadcast(LOWEST)
    lowest2, highest2 = lowest, highest
    for i in range(side):
        row, up = at + i * wide, level + north * broadcast(away[i])
        for d in range(side):
            far = broadcast(away[d])
            low = fused_multiply_add(west, far, load(lower, row + d)) - up
            high = fused_multiply_add(west, far, load(upper, row + d)) - up
            lowest2, highest2 = (
                minimum(maximum(low, lowest), lowest2),
                maximum(minimum(high, highest), highest2),
            )
            lowest, highest = minimum(low, lowest), maximum(high, highest)
    return maximum(minimum(highest2 - lowest, highest - lowest2), broadcast(F0))


@kernel_for_any_types
def reliefs(
    lower: Row, upper: Row, at: int, wide: int, away: Row, west: Pair, north: Pair, level: Pair
) -> Pair:
    """Return the relief of 16 footprints about their planes, and of the 16 footprints one row to the north.

    Parameters
    ----------
    lower, upper
        Lowest and highest ground of the cells, `wide` cells a row; +inf and -inf where unknown.
    at
        Index of the south-west cell of the first footprint.
    away
        East offsets of the columns of a footprint from its middle, in cells.
    west, north, level
        For both rows: fall of the planes to the east and rise to the north per cell, and height at the
        middle.
    """
    side = len(away)
    low, high = _of_row(lower, upper, at, away, 0, side, west[0])
    up = level[0] + north[0] * broadcast(away[0])
    lowest, highest = low - up, high - up
    low, high = _of_row(lower, upper, at + side * wide, away, 0, side, west[1])
    up = level[1] + north[1] * broadcast(away[side - 1])
    lowest2, highest2 = low - up, high - up
    for i in range(1, side):
        row, low, high = at + i * wide, broadcast(HIGHEST), broadcast(LOWEST)
        low2, high2 = low, high
        for d in range(side):  # each cell is loaded once for both rows of footprints
            far, bottom, top = broadcast(away[d]), load(lower, row + d), load(upper, row + d)
            low = minimum(fused_multiply_add(west[0], far, bottom), low)
            high = maximum(fused_multiply_add(west[0], far, top), high)
            low2 = minimum(fused_multiply_add(west[1], far, bottom), low2)
            high2 = maximum(fused_multiply_add(west[1], far, top), high2)
        up, up2 = level[0] + north[0] * broadcast(away[i]), level[1] + north[1] * broadcast(away[i - 1])
        lowest, highest = minimum(low - up, lowest), maximum(high - up, highest)
        lowest2, highest2 = minimum(low2 - up2, lowest2), maximum(high2 - up2, highest2)
    return maximum(highest - lowest, broadcast(F0)), maximum(highest2 - lowest2, broadcast(F0))


@kernel_part
def _fit(
    sums: Row,
    rises: Wide,
    row: int,
    col: int,
    away: Row,
    covered: Array1D[np.uint64],
    limits: Limits,
    statistics: Row,
    plane: Row,
) -> np.uint64:
    """Write planes and statistics of 16 footprints; return a mask of those whose relief is needed."""
    cell_m, noise_m, slope_limit, _, _ = limits
    rows = len(covered)
    wide = len(sums) // (SUMS * rows)
    s = over_columns(sums, row * wide + col, rows * wide, away, row - rows // 2)
    z = rises_over_columns(rises, row * wide + col, rows * wide, away, float(row - rows // 2))
    w, nothing, unknown, per_m = s[W], broadcast(F0), broadcast(NAN), broadcast(F1 / cell_m)
    share = broadcast(F1) / w
    mx, my, wide_share = s[WX] * share, s[WY] * share, widened(share)
    # Newton step: to double precision.
    wide_share = wide_share * (broadcast_wide(D2) - widened(w) * wide_share)
    mz = z[WZ] * wide_share
    sxx, sxy, syy = s[WXX] - s[WX] * mx, s[WXY] - s[WX] * my, s[WYY] - s[WY] * my
    sxz, syz = narrowed(z[WXZ] - widened(s[WX]) * mz), narrowed(z[WYZ] - widened(s[WY]) * mz)
    szz = narrowed(z[WZZ] - z[WZ] * mz)
    free, det, trace = w - broadcast(F3), sxx * syy - sxy * sxy, sxx + syy
    good = logical_and(
        flags(covered[row]), logical_and(broadcast(LEAST_CELLS) < w, broadcast(THIN) * trace * trace < det)
    )
    over_both = broadcast(F1) / (free * det)
    scale, over_free = over_both * free, over_both * det
    a, b = (sxz * syy - syz * sxy) * scale, (syz * sxx - sxz * sxy) * scale
    left = szz - a * sxz - b * syz
    squares = where(nothing < left, left, nothing)
    single2, spread2 = broadcast(noise_m * noise_m) * (s[S_INVERSE] * share), squares * over_free
    noise2 = where(single2 < spread2, spread2, single2)
    square = (a * a + b * b) * (per_m * per_m)
    slope = arctangent(where(good, sqrt(square), unknown)) * broadcast(DEGREES)
    sigma = (
        sqrt(noise2 * broadcast(HALF) * trace * scale) * per_m / (broadcast(F1) + square) * broadcast(DEGREES)
    )
    at, to = row * PLANE_STATISTICS * LANES, row * PLANE * LANES
    store(statistics, at + SLOPE * LANES, slope)
    store(statistics, at + SIGMA * LANES, where(good, sigma, unknown))
    store(statistics, at + RMS * LANES, where(good, sqrt(squares * share), unknown))
    store(statistics, at + NOISE2 * LANES, where(good, s[S_NOISE] * share, unknown))
    seen = w * broadcast(F1 / np.float32(len(away) * len(away)))
    store(statistics, at + SHARE * LANES, where(good, seen, unknown))
    store(statistics, at + RELIEF * LANES, unknown)
    store(plane, to + WEST * LANES, nothing - a)
    store(plane, to + NORTH * LANES, b)
    store(plane, to + LEVEL * LANES, narrowed(mz) - a * mx - b * my)
    return flags_of(logical_and(good, slope < broadcast(slope_limit) + broadcast(SIGMAS) * sigma))


@kernel_part
def _add_relief(
    lower: Row,
    upper: Row,
    row: int,
    col: int,
    wide: int,
    away: Row,
    asked: np.uint64,
    asked_north: np.uint64,
    plane: Row,
    statistics: Row,
) -> None:
    """Write the reliefs of 16 footprints of a row and of the next row to the north, where asked for."""
    p, q, at = row * PLANE * LANES, (row + 1) * PLANE * LANES, row * PLANE_STATISTICS * LANES + RELIEF * LANES
    west = load(plane, p + WEST * LANES), load(plane, q + WEST * LANES)
    north = load(plane, p + NORTH * LANES), load(plane, q + NORTH * LANES)
    level = load(plane, p + LEVEL * LANES), load(plane, q + LEVEL * LANES)
    whole, whole_north = reliefs(lower, upper, row * wide + col, wide, away, west, north, level)
    store(statistics, at, where(flags(asked), whole, broadcast(NAN)))
    store(statistics, at + PLANE_STATISTICS * LANES, where(flags(asked_north), whole_north, broadcast(NAN)))


@kernel_part
def add_inner_relief(
    lower: Row, upper: Row, row: int, col: int, wide: int, away: Row, plane: Row, statistics: Row
) -> None:
    """Write the relief of 16 footprints of a row without the cell that stands out most, see `fit_planes`.

    Where the heights deviate from the plane as if `MANY` cells or more stood out, it is the relief itself: an
    object struck all over is no clutter.
    """
    p, at = row * PLANE * LANES, row * PLANE_STATISTICS * LANES
    west, north = load(plane, p + WEST * LANES), load(plane, p + NORTH * LANES)
    level = load(plane, p + LEVEL * LANES)
    without = relief_without_one(lower, upper, row * wide + col, wide, away, west, north, level)
    whole, rms = load(statistics, at + RELIEF * LANES), load(statistics, at + RMS * LANES)
    known = load(statistics, at + SHARE * LANES) * broadcast(np.float32(len(away) * len(away)))
    few = known * rms * rms < broadcast(MANY) * whole * whole
    store(statistics, at + INNER * LANES, where(few, minimum(without, whole), whole))


@kernel_part
def fit_planes(
    sums: Row,
    rises: Wide,
    lower: Row,
    upper: Row,
    wide: int,
    col: int,
    away: Row,
    covered: Array1D[np.uint64],
    asked: Array1D[np.uint64],
    limits: Limits,
    statistics: Row,
    plane: Row,
) -> None:
    """Fit a plane to the cells of each footprint of a patch in 16 columns, and write its statistics.

    Parameters
    ----------
    sums, rises
        Sums over the footprints' rows, see `slz.kernels.footprint.moments.over_rows`.
    lower, upper
        Lowest and highest ground of the cells, `wide` cells a row.
    col
        Column of the first footprint.
    away
        East offsets of the columns of a footprint from its middle, in cells.
    covered
        For each row, a mask of the footprints that are wholly covered by seen cells.
    asked, limits
        For each row, a mask of those wanted; a pair of rows without any is left out. See `derive_box`.
    statistics
        (rows, PLANE_STATISTICS, 16), flat: receives the statistics. NaN where a footprint is not covered, has
        fewer than six cells with a height or only collinear ones; the relief also where the slope exceeds its
        limit by `SIGMAS` standard errors. INNER is left to `add_inner_relief`.
    plane
        (rows, PLANE, 16), flat: receives the planes, undefined where there is none.
    """
    for j in range(0, len(covered), 2):
        if asked[j] | asked[j + 1] == NONE:
            continue
        south = _fit(sums, rises, j, col, away, covered, limits, statistics, plane)
        north = _fit(sums, rises, j + 1, col, away, covered, limits, statistics, plane)
        if south | north != NONE:
            _add_relief(lower, upper, j, col, wide, away, south, north, plane, statistics)
