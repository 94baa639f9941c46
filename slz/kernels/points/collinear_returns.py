"""Lines of isolated returns: thin things near the ground that hang, rise or run level, and return little.

A line through two returns counts if clutter alone would put so many others into the tube around it in fewer
than `FALSE_LINES` of the returns tried: an a-contrario test (Desolneux, Moisan and Morel, International
Journal of Computer Vision 40, 2000). Clutter is as dense there as in the cylinder around the tube.
"""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.array_memory import put
from slz.kernels.elementary_functions import ranked
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.points.clutter import by_chance
from slz.kernels.points.nearest_others import (
    BAND,
    EAST,
    FATE,
    FOUND,
    LINE,
    LOW,
    NORTH,
    OVER,
    RAYS,
    RINGS,
    STAYS,
    TRIED,
    UP,
    WAS_FOUND,
    sorted_by_square,
)

FALSE_LINES = 1e-4  # of the returns tried
HIGHEST_M = 6.0  # over the ground; above are wires, `slz.wires`
REACH_M, MOST_NEAR = 8.0, 64  # others of a return with which lines are tried: the nearest ones
SQUARE_M = REACH_M / RINGS  # side of the squares in which others are looked for
SHORTEST_M, PLACE_M = 0.5, 0.3  # length of a line; returns nearer to each other are of one place
TUBES_M = (0.03, 0.06, 0.12)  # radii of the tubes that are tried
INNER_M, AROUND_M = 0.24, 1.0  # radii of the shell around in which clutter is counted
SPREAD = 0.6  # of the places that returns spread evenly would take: others are a row of things
FEWEST = 4  # places of a line
GAPS = 2.0  # between its returns on average, beyond its ends, within which another return is of it
UNSEEN = 7.0  # returns of a line expected since its last one, that are missing: it is gone

# A line: its ends, how far it may go on beyond them, how many returns it has, and the mean rays per m² that
# had passed these at the latest one.
START, STOP, BEYOND, PLACES, SEEN_RAYS, LINE_FIELDS = 0, 3, 6, 7, 8, 9


@kernel_part
def _along(
    records: Array2D[np.float64], i: int, origin: Array1D[np.float64], unit: Array1D[np.float64]
) -> tuple[float, float]:
    """Return how far along a line a return is, and its squared distance from the line."""
    x, y, z = records[i, 0] - origin[0], records[i, 1] - origin[1], records[i, 2] - origin[2]
    along = x * unit[0] + y * unit[1] + z * unit[2]
    return along, x * x + y * y + z * z - along * along


@kernel_part
def _is_candidate(records: Array2D[np.float64], i: int) -> bool:
    """Return whether a return is near the ground and above it."""
    return bool(records[i, FATE] == STAYS and records[i, BAND] >= LOW and records[i, OVER] <= HIGHEST_M)


@kernel_part
def _nearest(
    i: int,
    order: Array1D[np.int64],
    places: Array2D[np.float64],
    starts: Array1D[np.int64],
    at: Array1D[np.int64],
    cols: int,
    records: Array2D[np.float64],
) -> tuple[Array1D[np.int64], float]:
    """Return up to `MOST_NEAR` candidates that are nearest to a return, and their reach."""
    east, north, up = records[i, EAST], records[i, NORTH], records[i, UP]
    away, near, n = np.empty(len(order)), np.empty(len(order), np.int64), 0
    for row in range(-RINGS, RINGS + 1):
        first = at[i] + row * cols
        for k in range(starts[first - RINGS], starts[first + RINGS + 1]):
            x, y, z = places[k, 0] - east, places[k, 1] - north, places[k, 2] - up
            distance2 = x * x + y * y + z * z
            if distance2 <= REACH_M * REACH_M and order[k] != i:
                away[n], near[n] = distance2, order[k]
                n += 1
    if n <= MOST_NEAR:
        return near[:n].copy(), REACH_M
    most = ranked(away[:n].copy(), MOST_NEAR)
    return near[:n][away[:n] < most], math.sqrt(most)


@kernel_part
def _places(along: Array1D[np.float64], low_m: float, high_m: float) -> tuple[int, int]:
    """Return at how many places of a stretch returns along a line, ascending, are; and how many returns."""
    places, returns, at = 0, 0, -np.inf
    for k in range(len(along)):
        if low_m <= along[k] <= high_m:
            returns += 1
            if along[k] - at >= PLACE_M:
                places, at = places + 1, along[k]
    return places, returns


@kernel_part
def _is_spread(along: Array1D[np.float64], low_m: float, high_m: float) -> bool:
    """Return whether the returns of a stretch are at about as many places as if spread evenly."""
    bins = (high_m - low_m) / PLACE_M + 1
    places, returns = _places(along, low_m, high_m)
    return places >= SPREAD * bins * (1.0 - (1.0 - 1.0 / bins) ** returns)


@kernel_part
def _best_run(
    along: Array1D[np.float64], along_widest: Array1D[np.float64], clutter_m: float, own_m: float
) -> tuple[float, int, int]:
    """Return the false alarms of the least likely run with a return and another, and its first and last.

    along, along_widest: returns of a tube and of the widest one, ascending. clutter_m: returns of clutter
    expected in the tube, per metre.
    """
    n, best, first_of, last_of, runs = len(along), np.inf, 0, 0, 0
    low, high = min(0.0, own_m), max(0.0, own_m)
    for first in range(n):
        if along[first] > low:
            break
        for last in range(n - 1, first, -1):
            if along[last] < high:
                break
            long = along[last] - along[first]
            places, _ = _places(along, along[first], along[last])
            if places < FEWEST or long < SHORTEST_M:
                continue
            runs += 1
            chance = by_chance(places - 2, clutter_m * long)
            if chance < best and _is_spread(along_widest, along[first], along[last]):
                best, first_of, last_of = chance, first, last
    return best * runs, first_of, last_of


@kernel_part
def _try_return(
    records: Array2D[np.float64], i: int, near: Array1D[np.int64], reach_m: float, out: Array1D[np.float64]
) -> float:
    """Write the least likely line through a return and others near, and return its false alarms a return."""
    origin, unit = records[i, : UP + 1].copy(), np.empty(3)
    along, aside2, members = np.zeros(len(near) + 1), np.zeros(len(near) + 1), np.full(len(near) + 1, i)
    best = FALSE_LINES
    for j in near:
        for axis in range(3):
            unit[axis] = records[j, axis] - origin[axis]
        own_m = math.sqrt(unit[0] * unit[0] + unit[1] * unit[1] + unit[2] * unit[2])
        if own_m < SHORTEST_M:
            continue
        for axis in range(3):
            unit[axis] /= own_m
        n, around = 1, 1
        for k in near:
            at, away2 = _along(records, k, origin, unit)
            if away2 < TUBES_M[-1] * TUBES_M[-1]:
                along[n], aside2[n], members[n] = at, away2, k
                n += 1
            around += INNER_M * INNER_M <= away2 < AROUND_M * AROUND_M
        if n < FEWEST:
            continue
        order = np.argsort(along[:n])
        density = around / ((AROUND_M * AROUND_M - INNER_M * INNER_M) * 2 * reach_m)
        for tube_m in TUBES_M:
            inside = order[aside2[order] < tube_m * tube_m]
            chance, first, last = _best_run(along[inside], along[order], density * tube_m * tube_m, own_m)
            chance *= len(TUBES_M) * len(near)
            if chance < best:
                best = chance
                put(out, START, records[members[inside[first]], : UP + 1])
                put(out, STOP, records[members[inside[last]], : UP + 1])
                out[BEYOND] = _long_m(out) / (last - first)
    return best


@kernel_part
def _long_m(line: Array1D[np.float64]) -> float:
    """Return the length of a line."""
    x, y, z = line[STOP] - line[START], line[STOP + 1] - line[START + 1], line[STOP + 2] - line[START + 2]
    return math.sqrt(x * x + y * y + z * z)


@kernel_part
def _join(
    records: Array2D[np.float64], some: Array1D[np.int64], line: Array1D[np.float64], number: int
) -> bool:
    """Let those of some returns that are in a line's tube be of it; return whether it is longer by them."""
    unit, long = np.empty(3), _long_m(line)
    for axis in range(3):
        unit[axis] = (line[STOP + axis] - line[START + axis]) / long
    origin, low, high, start, stop = line[START : START + 3].copy(), -1e-9, long + 1e-9, -1, -1
    beyond, count = line[BEYOND], 0
    for i in some:
        along, aside2 = _along(records, i, origin, unit)
        if (
            records[i, LINE] == 0.0
            and aside2 < TUBES_M[-1] * TUBES_M[-1]
            and -GAPS * beyond <= along <= long + GAPS * beyond
        ):
            records[i, LINE] = number
            count += 1
            if along < low:
                low, start = along, i
            if along > high:
                high, stop = along, i
    line[PLACES] += count
    if start >= 0:
        put(line, START, records[start, : UP + 1])
    if stop >= 0:
        put(line, STOP, records[stop, : UP + 1])
    line[BEYOND] = _long_m(line) / max(1.0, line[PLACES] - 1)
    return start >= 0 or stop >= 0


@kernel_part
def _begin(
    records: Array2D[np.float64], some: Array1D[np.int64], line: Array1D[np.float64], number: int
) -> bool:
    """Let returns be of a new line; return whether it has enough that are of no other."""
    line[PLACES] = line[SEEN_RAYS] = 0.0
    while _join(records, some, line, number):
        pass
    for i in some:
        if records[i, LINE] == number:
            line[SEEN_RAYS] += records[i, RAYS] / line[PLACES]
            if line[PLACES] < FEWEST - 1:
                records[i, LINE] = 0.0
    return bool(line[PLACES] >= FEWEST - 1)


@kernel_part
def _kept_lines(records: Array2D[np.float64], lines: Array2D[np.float64], out: Array2D[np.float64]) -> int:
    """Copy the lines that are still there, number their returns anew, and return how many they are."""
    rays, count, has_new = np.zeros(len(lines)), np.zeros(len(lines)), np.zeros(len(lines), np.bool_)
    for i in range(len(records)):
        k = int(records[i, LINE]) - 1
        if k >= 0 and records[i, FATE] == STAYS:
            rays[k] += records[i, RAYS]
            count[k] += 1
            has_new[k] |= records[i, TRIED] == 0.0
    number, n = np.zeros(len(lines) + 1), 0
    for k in range(len(lines)):
        mean = rays[k] / max(count[k], 1.0)
        if has_new[k]:
            lines[k, SEEN_RAYS] = mean
        if count[k] < FEWEST - 1 or mean > lines[k, SEEN_RAYS] * (1.0 + UNSEEN / lines[k, PLACES]):
            continue
        put(out[n], 0, lines[k])
        n += 1
        number[k + 1] = n
    for i in range(len(records)):
        records[i, LINE] = number[int(records[i, LINE])]
    return n


@kernel
def follow_lines(records: Array2D[np.float64], lines: Array2D[np.float64]) -> Array2D[np.float64]:
    """Return the lines (m, LINE_FIELDS) that are still there, and those that new returns make.

    Returns that are objects by themselves make none, as long as they are, but may be of one.

    Parameters
    ----------
    records
        (n, ISOLATED_FIELDS) isolated returns, changed: LINE is the number of the line that one is of, from 1
        on, TRIED is 1 for all candidates, and FOUND for those of a line.
    lines
        (m, LINE_FIELDS) lines so far; changed.
    """
    is_candidate, is_new = np.zeros(len(records), np.bool_), np.zeros(len(records), np.bool_)
    for i in range(len(records)):
        is_candidate[i] = _is_candidate(records, i)
        is_left = records[i, WAS_FOUND] > 0.0 and records[i, FOUND] == 0.0
        is_fresh = records[i, TRIED] == 0.0 or is_left
        is_new[i] = is_candidate[i] and is_fresh and records[i, LINE] == 0.0
    some, new = np.nonzero(is_candidate)[0], np.nonzero(is_new)[0]
    for k in range(len(lines)):
        if _join(records, new, lines[k], k + 1):
            while _join(records, some, lines[k], k + 1):
                pass
    out = np.empty((len(lines) + len(new), LINE_FIELDS))
    n = _kept_lines(records, lines, out)
    tried = new[(records[new, LINE] == 0.0) & (records[new, FOUND] == 0.0)]
    if len(tried):
        order, places, at, starts, cols = sorted_by_square(records, is_candidate, tried, SQUARE_M)
        found, chances = np.empty((len(tried), LINE_FIELDS)), np.empty(len(tried))
        for k in range(len(tried)):
            near, reach_m = _nearest(tried[k], order, places, starts, at, cols, records)
            chances[k] = _try_return(records, tried[k], near, reach_m, found[k])
        for best in np.argsort(chances):
            if chances[best] < FALSE_LINES and records[tried[best], LINE] == 0.0:
                put(out[n], 0, found[best])
                n += _begin(records, some, out[n], n + 1)
    for each in some:
        records[each, TRIED] = 1.0
        if records[each, LINE] > 0.0:
            records[each, FOUND] = 1.0
    return out[:n].copy()


@kernel
def points_along(lines: Array2D[np.float64], step_m: float) -> Array2D[np.float64]:
    """Return places (n, 3) along lines, `step_m` apart at most, and on beyond both ends by one gap."""
    counts = np.empty(len(lines), np.int64)
    for k in range(len(lines)):
        counts[k] = math.ceil((_long_m(lines[k]) + 2 * lines[k, BEYOND]) / step_m) + 1
    out, n = np.empty((counts.sum(), 3)), 0
    for k in range(len(lines)):
        beyond = lines[k, BEYOND] / _long_m(lines[k])
        for at in range(counts[k]):
            share = (1 + 2 * beyond) * at / (counts[k] - 1) - beyond
            for axis in range(3):
                out[n, axis] = lines[k, START + axis] * (1 - share) + lines[k, STOP + axis] * share
            n += 1
    return out
