"""Clutter: ground and rays around isolated returns, and the chance that clutter alone explains them."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D, Strided2D, Strided5D
from slz.kernels.cells.accumulate import mean_height, slot_at
from slz.kernels.cells.cell_record import (
    BOTTOM,
    COUNT,
    EXCESS,
    HEIGHT,
    SPREAD,
    TILE,
    TOP,
    WEIGHT,
)
from slz.kernels.jit import kernel, kernel_part

AROUND = 2  # cells to each side in which rays are counted and ground is looked for
BESIDE = 1  # cells to each side whose ground a return may belong to

# Bands of height over ground, which have clutter of their own kind: multipath below it, dust close above it,
# and what floats higher.
BELOW, LOW, HIGH = range(3)
BANDS, NO_BAND = 3, -1
HIGH_M = 2.5

NEAREST_M = 0.04  # no two returns count as nearer than this: the noise of their places
SQUARE_M, RINGS = 0.5, 8  # squares in which others are looked for, and how many to each side
REACH_M = SQUARE_M * RINGS  # farthest other return that supports one
LEVEL_M = 0.25  # greatest height difference of two returns of a level object, such as a wire
UPRIGHT_M = 1.0  # greatest height difference of two returns of an upright object in the highest band
LONELY_M, LONELY_LEVEL_M = 0.3, 0.6  # without another so near, at any height or level: clutter, for its share
MOST_OTHERS = 6  # others considered
OPAQUE = 0.08  # least share of the rays through an object close to the ground that it returns


@kernel
def ground_and_rays(
    points: Strided2D[np.float64],
    west: float,
    south: float,
    cell: float,
    tile_row: int,
    tile_col: int,
    pool: Strided5D[np.float32],
    table: Strided2D[np.int32],
) -> Array2D[np.float64]:
    """Return (n, 2) height over the nearest ground and rays per m² that reached ground.

    They are those of the 5 x 5 cells around each point, of both epochs. The nearest ground is the one nearest
    in height, of the 3 x 3 cells if any of them holds ground. The height is NaN without ground.

    Parameters
    ----------
    points
        (n, 3), in the heights of the evidence.
    tile_row, tile_col, pool, table
        Evidence, see `slz.terrain.tiles.Tiles`.
    """
    out = np.empty((len(points), 2))
    for i in range(len(points)):
        c0 = int(np.floor((points[i, 0] - west) / cell))
        r0 = int(np.floor((points[i, 1] - south) / cell))
        over, near, count = np.nan, np.nan, 0.0
        for dr in range(-AROUND, AROUND + 1):
            for dc in range(-AROUND, AROUND + 1):
                r, c = r0 + dr, c0 + dc
                slot = slot_at(r, c, tile_row, tile_col, table)
                if slot < 0:
                    continue
                held = pool[slot, r & (TILE - 1), c & (TILE - 1)]
                now, before = held[0], held[1]
                if now[COUNT] == 0:
                    continue
                count += now[COUNT] + before[COUNT]
                away = points[i, 2] - mean_height(now, before)
                if not abs(away) >= abs(over):
                    over = away
                if max(abs(dr), abs(dc)) <= BESIDE and not abs(away) >= abs(near):
                    near = away
        out[i, 0] = over if np.isnan(near) else near
        out[i, 1] = count / ((2 * AROUND + 1) * cell) ** 2
    return out


@kernel
def bands_of(over_m: Array1D[np.float64]) -> Array1D[np.int64]:
    """Return the band of each height over ground, `NO_BAND` of NaN."""
    out = np.full(len(over_m), NO_BAND)
    for i in range(len(over_m)):
        if not np.isnan(over_m[i]):
            out[i] = BELOW if over_m[i] < 0 else HIGH if over_m[i] > HIGH_M else LOW
    return out


@kernel
def by_chance(others: int, expected: float) -> float:
    """Return the probability that a Poisson variable of this mean is at least `others`."""
    term = total = math.exp(-expected)
    for j in range(1, others):
        term *= expected / j
        total += term
    return max(0.0, 1.0 - total)


@kernel_part
def _insert(sorted_m: Array1D[np.float64], distance_m: float) -> None:
    """Insert a distance in ascending order; the largest is lost."""
    k = len(sorted_m) - 1
    if distance_m >= sorted_m[k]:
        return
    while k > 0 and sorted_m[k - 1] > distance_m:
        sorted_m[k] = sorted_m[k - 1]
        k -= 1
    sorted_m[k] = distance_m


@kernel_part
def _sorted_by_square(
    points: Array2D[np.float64], bands: Array1D[np.int64], new: Array1D[np.bool_]
) -> tuple[Array1D[np.int64], Array1D[np.int64], Array1D[np.int64], int]:
    """Return returns near new ones by squares, the square of each or -1, the squares' starts and columns."""
    west = south = np.inf
    east = north = -np.inf
    for i in range(len(points)):
        if new[i] and bands[i] != NO_BAND:
            west, south = min(west, points[i, 0]), min(south, points[i, 1])
            east, north = max(east, points[i, 0]), max(north, points[i, 1])
    at = np.full(len(points), -1, np.int64)
    if not west <= east:
        return np.empty(0, np.int64), at, np.zeros(1, np.int64), 0
    west, south = west - (RINGS + 1) * SQUARE_M, south - (RINGS + 1) * SQUARE_M
    cols, rows = int((east - west) / SQUARE_M) + RINGS + 2, int((north - south) / SQUARE_M) + RINGS + 2
    starts = np.zeros(rows * cols + 1, np.int64)
    for i in range(len(points)):
        x = int(np.floor((points[i, 0] - west) / SQUARE_M))
        y = int(np.floor((points[i, 1] - south) / SQUARE_M))
        if bands[i] != NO_BAND and 0 <= x < cols and 0 <= y < rows:
            at[i] = y * cols + x
            starts[at[i] + 1] += 1
    for k in range(rows * cols):
        starts[k + 1] += starts[k]
    order, filled = np.empty(starts[-1], np.int64), starts.copy()
    for i in range(len(points)):
        if at[i] >= 0:
            order[filled[at[i]]] = i
            filled[at[i]] += 1
    return order, at, starts, cols


@kernel_part
def _add_other(
    i: int,
    band: int,
    away_m: float,
    rise_m: float,
    upright: Array2D[np.float64],
    level: Array2D[np.float64],
    lonely: Array1D[np.bool_],
) -> None:
    if rise_m <= UPRIGHT_M and away_m <= (LONELY_LEVEL_M if rise_m <= LEVEL_M else LONELY_M):
        lonely[i] = False
    if band != HIGH or rise_m <= UPRIGHT_M:
        _insert(upright[i], away_m)
    if rise_m <= LEVEL_M:
        _insert(level[i], away_m)


@kernel
def add_others(
    points: Array2D[np.float64],
    bands: Array1D[np.int64],
    new: Array1D[np.bool_],
    reaches_m: Array1D[np.float64],
    upright: Array2D[np.float64],
    level: Array2D[np.float64],
    lonely: Array1D[np.bool_],
) -> None:
    """Add new returns to the nearest others of all, and the nearest others of the new ones.

    Others are of the same band and within the reach of the new one; of an upright object those at any height
    of the band, in the highest band those within `UPRIGHT_M`; of a level object those within `LEVEL_M` of
    height.

    Parameters
    ----------
    points, bands, new, reaches_m
        (n, 3) returns, the band of each or `NO_BAND`, flags of the new ones, and the reach of each (m).
    upright, level
        (n, MOST_OTHERS) horizontal distances of the others, ascending, infinite where there is none.
    lonely
        (n,) cleared for returns with another within `LONELY_M` and `UPRIGHT_M` of height, or within
        `LONELY_LEVEL_M` and `LEVEL_M`.
    """
    order, at, starts, cols = _sorted_by_square(points, bands, new)
    for i in range(len(points)):
        if not new[i] or at[i] < 0:
            continue
        reach_m = reaches_m[i]
        rings = math.ceil(reach_m / SQUARE_M)
        for row in range(-rings, rings + 1):
            first = at[i] + row * cols
            for k in range(starts[first - rings], starts[first + rings + 1]):
                j = order[k]
                east, north = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1]
                away2 = east * east + north * north
                if away2 > reach_m * reach_m or j == i or bands[j] != bands[i]:
                    continue
                rise, away = abs(points[i, 2] - points[j, 2]), max(math.sqrt(away2), NEAREST_M)
                _add_other(i, bands[i], away, rise, upright, level, lonely)
                if not new[j]:
                    _add_other(j, bands[i], away, rise, upright, level, lonely)


@kernel_part
def _least_chance(others_m: Array1D[np.float64], rays_m2: float, share: float, opaque: bool) -> float:
    least = 1.0
    for k in range(1, len(others_m) + 1):
        rays = rays_m2 * math.pi * others_m[k - 1] ** 2
        if rays < np.inf and (not opaque or k + 1 >= OPAQUE * rays):
            least = min(least, by_chance(k, rays * share))
    return least


@kernel
def chances(
    upright: Array2D[np.float64],
    level: Array2D[np.float64],
    opaque: Array1D[np.bool_],
    rays_m2: Array1D[np.float64],
    upright_share: Array1D[np.float64],
    level_share: Array1D[np.float64],
) -> Array1D[np.float64]:
    """Return for each return the least probability that clutter alone puts this number of others so near.

    Parameters
    ----------
    upright, level
        (n, MOST_OTHERS) of `add_others`.
    opaque
        Whether a circle counts only if its returns are `OPAQUE` of the rays through it at least.
    rays_m2
        Rays per m² that passed at the height of the return.
    upright_share, level_share
        Share of these rays that clutter returns at the heights of an upright and of a level object.
    """
    out = np.empty(len(rays_m2))
    for i in range(len(out)):
        out[i] = min(
            _least_chance(upright[i], rays_m2[i], upright_share[i], opaque[i]),
            _least_chance(level[i], rays_m2[i], level_share[i], opaque[i]),
        )
    return out


@kernel
def put_onto(
    points: Strided2D[np.float64], west: float, south: float, cell: float, cells: Array3D[np.float32]
) -> None:
    """Extend top and bottom of the cells of a box to the points in them; a cell without returns gets theirs.

    Parameters
    ----------
    cells
        (6, rows, cols) of `slz.kernels.cells.cell_statistics.summarise`, from (west, south) on.
    """
    rows, cols = cells.shape[1:]
    for i in range(len(points)):
        c = int(np.floor((points[i, 0] - west) / cell))
        r = int(np.floor((points[i, 1] - south) / cell))
        if r < 0 or c < 0 or r >= rows or c >= cols:
            continue
        z = np.float32(points[i, 2])
        if cells[WEIGHT, r, c] == 0:
            cells[WEIGHT, r, c] = 1
            cells[HEIGHT, r, c] = cells[TOP, r, c] = cells[BOTTOM, r, c] = z
            cells[EXCESS, r, c] = cells[SPREAD, r, c] = 0
        else:
            cells[TOP, r, c] = max(cells[TOP, r, c], z)
            cells[BOTTOM, r, c] = min(cells[BOTTOM, r, c], z)
