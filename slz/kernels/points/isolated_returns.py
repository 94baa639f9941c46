"""Isolated returns of several windows: which stay, and which are no clutter."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D, Strided2D
from slz.kernels.array_memory import put
from slz.kernels.elementary_functions import ranked
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.points.clutter import is_unlikely
from slz.kernels.points.nearest_others import (
    BAND,
    BELOW,
    BORN,
    DISTANT,
    FATE,
    FOUND,
    GONE,
    GROUND,
    HELD,
    HIGH,
    HIGH_M,
    ISOLATED_FIELDS,
    LEVEL,
    LEVEL_M,
    LINE,
    LONELY,
    LONELY_LEVEL_M,
    LONELY_M,
    LOW,
    MOST_OTHERS,
    NO_BAND,
    NUMBER,
    OVER,
    RAYS,
    REACH_M,
    SENSOR_UP,
    SOLID_OBJECT,
    STAYS,
    UP,
    UPRIGHT,
    UPRIGHT_M,
    WAS_FOUND,
    add_others,
)

MOST = 8192  # returns kept
AGREES_M = 0.15  # from the ground: belongs to it
DISTANT_M = 0.3  # from the ground, up to which a distant return may belong to it
OPAQUE = 0.08  # least share of the rays through an object close to the ground that it returns
EXPLAINED = 2.0  # returns of clutter expected, among which `MOST_OTHERS` are no object

FALSE_ALARM = np.array([0.005, 0.005, 0.0008])  # below ground, low, high
SMALL_M, HAZARD_M2, CONTRADICTING = 0.5, 0.3**2, 5
SOLID = 5  # returns within `LONELY_M`, level and upright, that are an object for good
SMALLEST_M2, SURE = 0.005, 5  # what is no object: 5 pulses of one of 5 x 10 cm would have returned

MOST_SHARE = 0.02  # of the rays; what returns more is foliage, no clutter
LAYER_M = 2.0  # to each side in height, over which the share is measured
BIN_M, DEEPEST_M, TALLEST_M = 0.25, -50.0, 200.0  # bins of height; what is beyond is in the last one
BINS = round((TALLEST_M - DEEPEST_M) / BIN_M)


@kernel
def joined(
    records: Array2D[np.float64],
    points: Strided2D[np.float64],
    sensor: ReadOnly1D[np.float64],
    reach_m: float,
    now_s: float,
) -> Array2D[np.float64]:
    """Return the records (n, ISOLATED_FIELDS) that stay, those without a band first, and those of new ones.

    Parameters
    ----------
    points, sensor
        (m, 3) new returns and (3,) position of the sensor, in the heights of the evidence.
    reach_m
        Horizontal distance beyond which returns are distant.
    """
    waiting, placed, number = 0, 0, 0.0
    for i in range(len(records)):
        if records[i, FATE] == STAYS:
            waiting += records[i, BAND] == NO_BAND
            placed += records[i, BAND] != NO_BAND
            number = max(number, records[i, NUMBER])
    out = np.empty((waiting + placed + len(points), ISOLATED_FIELDS))
    new, k_waiting, k_placed = waiting + placed, 0, waiting
    for i in range(len(records)):
        if records[i, FATE] != STAYS:
            continue
        if records[i, BAND] == NO_BAND:
            k, k_waiting = k_waiting, k_waiting + 1
        else:
            k, k_placed = k_placed, k_placed + 1
        for field in range(ISOLATED_FIELDS):
            out[k, field] = records[i, field]
        out[k, WAS_FOUND] = out[k, FOUND]
    for i in range(len(points)):
        record = out[new + i]
        put(record, 0, points[i])
        record[BORN:UPRIGHT], record[UPRIGHT:] = 0.0, np.inf
        record[BORN], record[SENSOR_UP], record[NUMBER] = now_s, sensor[2], number + i + 1
        record[DISTANT] = math.hypot(points[i, 0] - sensor[0], points[i, 1] - sensor[1]) > reach_m
        record[OVER], record[BAND], record[LONELY] = np.nan, NO_BAND, 1.0
    return out


@kernel_part
def _rays_at_height(records: Array2D[np.float64], i: int) -> float:
    """Return the rays per m2 that passed at the height of a return; rays diverge downwards."""
    down, over = max(records[i, SENSOR_UP] - records[i, UP], 1.0), records[i, OVER]
    spread = (down + over) / down if over > 0.0 else 1.0
    return float(records[i, RAYS]) * (spread * spread)


@kernel
def place(
    records: Array2D[np.float64],
    seen: Strided2D[np.float64],
    now_s: float,
    max_age_s: float,
    high_share: float,
) -> Array1D[np.int64]:
    """Note what evidence says of each return, and make those others of all whose ground is known now.

    Returns that are too old and distant ones at the ground are GONE, those at the ground GROUND. The result
    are the indices of those without known ground.

    Parameters
    ----------
    records
        (n, ISOLATED_FIELDS), changed.
    seen
        (n, 2) of `slz.kernels.points.clutter.ground_and_rays`.
    high_share
        Clutter of a ray at the heights of an upright object in the highest band, as last known.
    """
    new, reaches_m, n = np.empty(len(records), np.int64), np.empty(len(records)), 0
    waiting, n_waiting = np.empty(len(records), np.int64), 0
    for i in range(len(records)):
        record, over, held = records[i], seen[i, 0], seen[i, 1]
        record[RAYS] += max(held - record[HELD], 0.0)
        record[HELD] = held
        known, unplaced = not np.isnan(over), record[BAND] == NO_BAND
        if known:
            record[OVER] = over
        too_old = not now_s - record[BORN] <= max_age_s
        if too_old or (record[DISTANT] and not abs(over) > DISTANT_M):
            record[FATE], record[BAND], record[FOUND] = GONE, NO_BAND, 0.0
        elif abs(over) <= AGREES_M:
            record[FATE], record[BAND], record[FOUND] = GROUND, NO_BAND, 0.0
        elif unplaced and not known:
            waiting[n_waiting] = i
            n_waiting += 1
        elif unplaced:
            record[BAND] = BELOW if over < 0 else HIGH if over > HIGH_M else LOW
            # Farther others make no object: an opaque one has more returns, and clutter explains so many.
            most = (MOST_OTHERS + 1) / OPAQUE
            if record[BAND] == HIGH:
                most = EXPLAINED / max(high_share, 1e-6)
            rays = max(_rays_at_height(records, i), 1e-3)
            new[n], reaches_m[n] = i, min(max(math.sqrt(most / (math.pi * rays)), LONELY_LEVEL_M), REACH_M)
            n += 1
    add_others(records, new[:n], reaches_m[:n])
    return waiting[:n_waiting].copy()


@kernel_part
def _bin(over_m: float) -> int:
    """Return the bin of a height."""
    return int(min(max(np.floor((over_m - DEEPEST_M) / BIN_M), 0.0), BINS - 1.0))


@kernel_part
def _returns_below(records: Array2D[np.float64], given_up: Array2D[np.int64]) -> Array1D[np.int64]:
    """Return (BINS + 1,) how many returns of clutter are below each edge of the bins."""
    below = np.zeros(BINS + 1, np.int64)
    for k in range(BINS):
        below[k + 1] = given_up[0, k] + given_up[1, k]
    for i in range(len(records)):
        if records[i, BAND] != NO_BAND and records[i, LONELY]:
            below[_bin(records[i, OVER]) + 1] += 1
    for k in range(BINS):
        below[k + 1] += below[k]
    return below


@kernel_part
def _keep_newest(records: Array2D[np.float64], stay: Array1D[np.int64]) -> None:
    """Let `MOST` of the returns stay; the oldest that do not count as objects go first."""
    if len(stay) <= MOST:
        return
    order = np.empty(len(stay))
    for n in range(len(stay)):
        order[n] = records[stay[n], NUMBER] + 2.0**52 * records[stay[n], FOUND]
    first = ranked(order.copy(), len(stay) - MOST)
    for n in range(len(stay)):
        if order[n] < first:
            records[stay[n], FATE], records[stay[n], FOUND] = GONE, 0.0


@kernel
def judge(records: Array2D[np.float64], given_up: Array2D[np.int64], rays: int) -> Array1D[np.float64]:
    """Judge which returns with a band count as objects and which stay, see `slz.terrain.thin_objects`.

    The result are the shares of the rays that clutter returns at the heights of an upright object, of the
    returns of the highest band.

    Parameters
    ----------
    records
        (n, ISOLATED_FIELDS), changed.
    given_up
        (2, BINS) lonely returns that stay no more, by height, of this epoch and the one before; changed.
    rays
        Rays of both epochs.
    """
    below = _returns_below(records, given_up)
    edges = (0, _bin(0.0), _bin(HIGH_M), BINS)
    high_shares, n_high = np.empty(len(records)), 0
    stay, n = np.empty(len(records), np.int64), 0
    for i in range(len(records)):
        record = records[i]
        if record[BAND] == NO_BAND:
            continue
        band, over = int(record[BAND]), record[OVER]
        first, end = edges[band], edges[band + 1]
        low, high = max(_bin(over - LAYER_M), first), min(_bin(over + LAYER_M) + 1, end)
        around = min((below[high] - below[low] + 1) / rays, MOST_SHARE)
        upright = min((below[end] - below[first] + 1) / rays, MOST_SHARE)
        if band == HIGH:
            upright = around * (UPRIGHT_M / LAYER_M)
            high_shares[n_high] = upright
            n_high += 1
        level, rays_m2 = min(around * (LEVEL_M / LAYER_M), upright), _rays_at_height(records, i)
        least = 0.0 if band == HIGH else OPAQUE
        certain = is_unlikely(records, i, UPRIGHT, rays_m2, upright, least, FALSE_ALARM[band])
        certain = certain or is_unlikely(records, i, LEVEL, rays_m2, level, least, FALSE_ALARM[band])
        small = abs(over) < SMALL_M and not record[DISTANT] and record[RAYS] * HAZARD_M2 < CONTRADICTING
        record[FOUND] = certain or small or record[LINE] > 0.0
        if certain and max(record[UPRIGHT + SOLID - 2], record[LEVEL + SOLID - 2]) <= LONELY_M:
            record[FATE], record[FOUND] = SOLID_OBJECT, 0.0
        elif not record[FOUND] and rays_m2 * SMALLEST_M2 >= SURE:
            record[FATE] = GONE
        else:
            stay[n] = i
            n += 1
    _keep_newest(records, stay[:n])
    for i in range(len(records)):
        if records[i, BAND] != NO_BAND and records[i, FATE] == GONE and records[i, LONELY]:
            given_up[0, _bin(records[i, OVER])] += 1
    return high_shares[:n_high].copy()


@kernel
def outcome(
    records: Array2D[np.float64],
) -> tuple[Array2D[np.float64], Array2D[np.float64], Array2D[np.float64]]:
    """Return places (k, 3): objects, what became one or ceased to be one, and what belongs to the surface.

    Of the surface those at the ground come first, then those that begin ground, then solid objects.
    """
    found, altered = np.empty((len(records), 3)), np.empty((len(records), 3))
    n_found, n_altered, starts = 0, 0, np.zeros(SOLID_OBJECT + 2, np.int64)
    for i in range(len(records)):
        for axis in range(3):
            found[n_found, axis] = altered[n_altered, axis] = records[i, axis]
        n_found += records[i, FOUND] > 0.0
        n_altered += records[i, FOUND] != records[i, WAS_FOUND]
        if records[i, FATE] >= GROUND:
            starts[int(records[i, FATE]) + 1] += 1
    starts = np.cumsum(starts)
    surface = np.empty((starts[-1], 3))
    for i in range(len(records)):
        if records[i, FATE] >= GROUND:
            for axis in range(3):
                surface[starts[int(records[i, FATE])], axis] = records[i, axis]
            starts[int(records[i, FATE])] += 1
    return found[:n_found], altered[:n_altered], surface
