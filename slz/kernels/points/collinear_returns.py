"""Lines of isolated returns: thin things that hang, rise or run level near the ground, however few returns.

A line through two returns counts if clutter alone would put so many others into the tube around it in fewer
than `FALSE_LINES` of the returns tried: an a-contrario test (Desolneux, Moisan and Morel, International
Journal of Computer Vision 40, 2000). Clutter is as dense there as in the cylinder around the tube.
"""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.array_memory import put
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.points.clutter import by_chance
from slz.kernels.points.nearest_others import BAND, FATE, LINE, LOW, NUMBER, OVER, RAYS, STAYS, TRIED, UP

FALSE_LINES = 1e-4  # of the returns tried
HIGHEST_M = 6.0  # over the ground; above are wires, `slz.wires`
REACH_M, MOST_NEAR = 8.0, 48  # others of a return with which lines are tried: the nearest ones
SHORTEST_M, PLACE_M = 0.5, 0.3  # length of a line; returns nearer to each other are of one place
TUBES_M, INNER_M, AROUND_M = (
    (0.03, 0.06, 0.12),
    0.24,
    1.0,
)  # radii of tubes, and of the shell of clutter around
SPREAD = 0.6  # of the places that returns spread evenly would take: others are a row of things
FEWEST = 4  # places of a line
UNSEEN = 7.0  # returns of a line expected since its last one, that are missing: it is gone

# A line: its end returns, their numbers, how many returns it has, and the rays per m² that had passed there
# at its latest one.
START, STOP, START_NUMBER, STOP_NUMBER, PLACES, SEEN_RAYS, LINE_FIELDS = 0, 3, 6, 7, 8, 9, 10


@kernel_part
def _along(
    records: Array2D[np.float64], i: int, origin: Array1D[np.float64], unit: Array1D[np.float64]
) -> tuple[float, float]:
    """Return how far along a line a return is, and its squared distance from the line."""
    x, y, z = records[i, 0] - origin[0], records[i, 1] - origin[1], records[i, 2] - origin[2]
    along = x * unit[0] + y * unit[1] + z * unit[2]
    return along, x * x + y * y + z * z - along * along


@kernel_part
def _candidates(records: Array2D[np.float64]) -> Array1D[np.int64]:
    """Return the indices of returns near the ground and above it."""
    out, n = np.empty(len(records), np.int64), 0
    for i in range(len(records)):
        if records[i, FATE] == STAYS and records[i, BAND] >= LOW and records[i, OVER] <= HIGHEST_M:
            out[n] = i
            n += 1
    return out[:n]


@kernel_part
def _nearest(
    records: Array2D[np.float64], i: int, some: Array1D[np.int64]
) -> tuple[Array1D[np.int64], float]:
    """Return up to `MOST_NEAR` of some returns that are nearest to a return, and their reach."""
    away, near, n = np.empty(len(some)), np.empty(len(some), np.int64), 0
    for j in some:
        x, y, z = records[j, 0] - records[i, 0], records[j, 1] - records[i, 1], records[j, 2] - records[i, 2]
        distance2 = x * x + y * y + z * z
        if distance2 <= REACH_M * REACH_M and j != i:
            away[n], near[n] = distance2, j
            n += 1
    if n <= MOST_NEAR:
        return near[:n].copy(), REACH_M
    most = np.sort(away[:n])[MOST_NEAR]
    kept = 0
    for k in range(n):
        if away[k] < most:
            near[kept] = near[k]
            kept += 1
    return near[:kept].copy(), math.sqrt(most)


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
    records: Array2D[np.float64], i: int, some: Array1D[np.int64], out: Array1D[np.float64]
) -> float:
    """Write the least likely line through a return, and return its number of false alarms a return."""
    near, reach_m = _nearest(records, i, some)
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
                _write(records, members[inside[first]], members[inside[last]], last - first + 1, out)
    return best


@kernel_part
def _write(
    records: Array2D[np.float64], start: int, stop: int, places: int, out: Array1D[np.float64]
) -> None:
    put(out, START, records[start, : UP + 1])
    put(out, STOP, records[stop, : UP + 1])
    out[START_NUMBER], out[STOP_NUMBER], out[PLACES] = records[start, NUMBER], records[stop, NUMBER], places
    out[SEEN_RAYS] = 0.5 * (records[start, RAYS] + records[stop, RAYS])


@kernel_part
def _follow(records: Array2D[np.float64], some: Array1D[np.int64], line: Array1D[np.float64]) -> bool:
    """Extend a line to new returns in its tube, mark its returns, and return whether it is still there."""
    unit, start, stop = np.empty(3), -1, -1
    for axis in range(3):
        unit[axis] = line[STOP + axis] - line[START + axis]
    long = math.sqrt(unit[0] * unit[0] + unit[1] * unit[1] + unit[2] * unit[2])
    for axis in range(3):
        unit[axis] /= long
    beyond = long / (line[PLACES] - 1)
    origin = line[START : START + 3].copy()
    members, low, high, count, has_new = np.empty(len(some), np.int64), np.inf, -np.inf, 0, False
    for i in some:
        along, aside2 = _along(records, i, origin, unit)
        if aside2 < TUBES_M[-1] * TUBES_M[-1] and -beyond <= along <= long + beyond:
            members[count] = i
            count += 1
            has_new |= records[i, TRIED] == 0.0
            if along < low:
                low, start = along, i
            if along > high:
                high, stop = along, i
    if count < FEWEST - 1 or high - low < SHORTEST_M:
        return False
    if has_new:
        _write(records, start, stop, max(count, int(line[PLACES])), line)
    elif 0.5 * (records[start, RAYS] + records[stop, RAYS]) > line[SEEN_RAYS] * (1.0 + UNSEEN / line[PLACES]):
        return False
    for k in range(count):
        records[members[k], LINE] = 1.0
    return True


@kernel
def follow_lines(records: Array2D[np.float64], lines: Array2D[np.float64]) -> Array2D[np.float64]:
    """Return the lines (m, LINE_FIELDS) that are still there, and those that new returns make.

    Parameters
    ----------
    records
        (n, ISOLATED_FIELDS) isolated returns, changed: LINE is 1 for those of a line, TRIED is 1 for all.
    lines
        (m, LINE_FIELDS) lines so far.
    """
    some, n = _candidates(records), 0
    out = np.empty((len(lines) + len(some), LINE_FIELDS))
    for i in range(len(records)):
        records[i, LINE] = 0.0
    for k in range(len(lines)):
        put(out[n], 0, lines[k])
        n += _follow(records, some, out[n])
    found, chances, through = (
        np.empty((len(some), LINE_FIELDS)),
        np.empty(len(some)),
        np.empty(len(some), np.int64),
    )
    m = 0
    for i in some:
        if records[i, TRIED] == 0.0 and records[i, LINE] == 0.0:
            chances[m], through[m] = _try_return(records, i, some, found[m]), i
            m += chances[m] < FALSE_LINES
    for k in np.argsort(chances[:m]):
        if records[through[k], LINE] == 0.0:
            put(out[n], 0, found[k])
            n += _follow(records, some, out[n])
    for i in some:
        records[i, TRIED] = 1.0
    return out[:n].copy()


@kernel
def points_along(lines: Array2D[np.float64], step_m: float) -> Array2D[np.float64]:
    """Return places (n, 3) along lines, `step_m` apart at most, and on beyond both ends by one gap."""
    counts = np.empty(len(lines), np.int64)
    for k in range(len(lines)):
        long2, beyond = 0.0, 1.0 / (lines[k, PLACES] - 1)
        for axis in range(3):
            long2 += (lines[k, STOP + axis] - lines[k, START + axis]) ** 2
        counts[k] = math.ceil((1 + 2 * beyond) * math.sqrt(long2) / step_m) + 1
    out, n = np.empty((counts.sum(), 3)), 0
    for k in range(len(lines)):
        beyond = 1.0 / (lines[k, PLACES] - 1)
        for at in range(counts[k]):
            share = (1 + 2 * beyond) * at / (counts[k] - 1) - beyond
            for axis in range(3):
                out[n, axis] = lines[k, START + axis] * (1 - share) + lines[k, STOP + axis] * share
            n += 1
    return out
