"""Others near isolated returns."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel_part

# EAST, NORTH, UP: place, in the heights of the evidence. BORN: time of its window (s). SENSOR_UP: height of
# the sensor then. NUMBER: ascending in the order of all windows. DISTANT: beyond the reach of the map. HELD:
# rays per m2 that the cells around hold; RAYS: the same, with those that the cells forgot. OVER: height over
# ground, as last known. BAND: of height over ground, `NO_BAND` before ground was known, and of those that go
# before they are judged. LONELY: without another near. FOUND: counts as an object; WAS_FOUND: did so after
# the last window. FATE: whether it stays, or why it goes. LINE: number of the line that it is of, from 1 on;
# TRIED: whether lines were sought through it. UPRIGHT, LEVEL: first of `MOST_OTHERS` horizontal distances of
# others, ascending, infinite where there is none.
(
    EAST, NORTH, UP, BORN, SENSOR_UP, NUMBER, DISTANT, HELD, RAYS, OVER, BAND, LONELY, FOUND, WAS_FOUND, FATE,
    LINE, TRIED,
) = range(17)  # fmt: skip
MOST_OTHERS = 6  # others considered
UPRIGHT, LEVEL, ISOLATED_FIELDS = 17, 17 + MOST_OTHERS, 17 + 2 * MOST_OTHERS

# Fates: GONE is too old, or of what is no object; the others belong to the surface.
STAYS, GONE, GROUND, LEVEL_GROUND, SOLID_OBJECT = range(5)

# Bands of height over ground, which have clutter of their own kind: multipath below it, dust close above it,
# and what floats higher.
BELOW, LOW, HIGH = range(3)
NO_BAND = -1
HIGH_M = 2.5


NEAREST_M = 0.04  # no two returns count as nearer than this: the noise of their places
SQUARE_M, RINGS = 0.5, 8  # squares in which others are looked for, and how many to each side
REACH_M = SQUARE_M * RINGS  # farthest other return that supports one
LEVEL_M = 0.25  # greatest height difference of two returns of a level object, such as a wire
UPRIGHT_M = 1.0  # greatest height difference of two returns of an upright object in the highest band
LONELY_M, LONELY_LEVEL_M = 0.3, 0.6  # without another so near, at any height or level: clutter, for its share


@kernel_part
def _insert(records: Array2D[np.float64], i: int, first: int, distance_m: float) -> None:
    """Insert a distance in ascending order; the largest is lost."""
    k = first + MOST_OTHERS - 1
    if distance_m >= records[i, k]:
        return
    while k > first and records[i, k - 1] > distance_m:
        records[i, k] = records[i, k - 1]
        k -= 1
    records[i, k] = distance_m


@kernel_part
def _add_other(records: Array2D[np.float64], i: int, away_m: float, rise_m: float) -> None:
    if rise_m <= UPRIGHT_M and away_m <= (LONELY_LEVEL_M if rise_m <= LEVEL_M else LONELY_M):
        records[i, LONELY] = 0.0
    if records[i, BAND] != HIGH or rise_m <= UPRIGHT_M:
        _insert(records, i, UPRIGHT, away_m)
    if rise_m <= LEVEL_M:
        _insert(records, i, LEVEL, away_m)


@kernel_part
def sorted_by_square(
    records: Array2D[np.float64], chosen: Array1D[np.bool_], around: Array1D[np.int64], square_m: float
) -> tuple[Array1D[np.int64], Array2D[np.float64], Array1D[np.int64], Array1D[np.int64], int]:
    """Return chosen returns within `RINGS` squares of some others, by squares.

    The others must not be empty.

    Returns
    -------
    tuple
        Indices of the returns, (k, 4) their places and bands; the square of each record, -1 for none, where
        the returns of each square begin, and the number of columns.
    """
    west = south = np.inf
    east = north = -np.inf
    for i in around:
        west, south = min(west, records[i, EAST]), min(south, records[i, NORTH])
        east, north = max(east, records[i, EAST]), max(north, records[i, NORTH])
    west, south = west - (RINGS + 1) * square_m, south - (RINGS + 1) * square_m
    cols, rows = int((east - west) / square_m) + RINGS + 2, int((north - south) / square_m) + RINGS + 2
    at, starts = np.full(len(records), -1, np.int64), np.zeros(rows * cols + 1, np.int64)
    for i in range(len(records)):
        if not chosen[i]:
            continue
        x = int(np.floor((records[i, EAST] - west) / square_m))
        y = int(np.floor((records[i, NORTH] - south) / square_m))
        if 0 <= x < cols and 0 <= y < rows:
            at[i] = y * cols + x
            starts[at[i] + 1] += 1
    for k in range(rows * cols):
        starts[k + 1] += starts[k]
    order, places, filled = np.empty(starts[-1], np.int64), np.empty((starts[-1], 4)), starts.copy()
    for i in range(len(records)):
        if at[i] >= 0:
            k = filled[at[i]]
            order[k], filled[at[i]] = i, k + 1
            places[k, 0], places[k, 1] = records[i, EAST], records[i, NORTH]
            places[k, 2], places[k, 3] = records[i, UP], records[i, BAND]
    return order, places, at, starts, cols


@kernel_part
def add_others(records: Array2D[np.float64], new: Array1D[np.int64], reaches_m: Array1D[np.float64]) -> None:
    """Add new returns to the nearest others of all, and the nearest others of the new ones.

    Others are of the same band and within the reach of the new one; of an upright object those at any height
    of the band, in the highest band those within `UPRIGHT_M`; of a level object those within `LEVEL_M` of
    height. A return with another within `LONELY_M` and `UPRIGHT_M` of height, or within `LONELY_LEVEL_M` and
    `LEVEL_M`, is not lonely.

    Parameters
    ----------
    records
        (n, ISOLATED_FIELDS), changed; those without a band are left out.
    new, reaches_m
        (m,) which of them are new, all with a band, and how far others of each may be.
    """
    if not len(new):
        return
    chosen = records[:, BAND] != NO_BAND
    order, places, at, starts, cols = sorted_by_square(records, chosen, new, SQUARE_M)
    is_new = np.zeros(len(records), np.bool_)
    is_new[new] = True
    for n in range(len(new)):
        i, reach_m = new[n], reaches_m[n]
        place, band, rings = records[i, : UP + 1], records[i, BAND], math.ceil(reach_m / SQUARE_M)
        for row in range(-rings, rings + 1):
            first = at[i] + row * cols
            for k in range(starts[first - rings], starts[first + rings + 1]):
                east, north, j = place[EAST] - places[k, 0], place[NORTH] - places[k, 1], order[k]
                away2 = east * east + north * north
                if away2 > reach_m * reach_m or places[k, 3] != band or j == i:
                    continue
                rise, away = abs(place[UP] - places[k, 2]), max(math.sqrt(away2), NEAREST_M)
                _add_other(records, i, away, rise)
                if not is_new[j]:
                    _add_other(records, j, away, rise)
