"""Hough transform of lines through given returns, and rays that pass a line."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly1D, ReadOnly2D
from slz.kernels.jit import kernel

# Fields of a candidate. EAST, NORTH, UP: place. SIGMA: standard deviation of the place (m). SEEN: time of its
# window (s). SENSOR: first of east, north and up of the sensor.
EAST, NORTH, UP, SIGMA, SEEN, SENSOR = range(6)
CANDIDATE_FIELDS = SENSOR + 3


BEARINGS, SLOPES = 180, 16  # bins of half a circle, and of slopes
STEEPEST = 0.48  # rise over distance
NEAREST_M, FARTHEST_M = 3.0, 25.0  # of the others that vote for a line through a return
SAG = 0.03  # by which the slope of a sagging line may differ from that towards another return


@kernel
def line_votes(seeds: Array1D[np.int64], points: Array2D[np.float64]) -> Array2D[np.float64]:
    """Return (seeds, 3) votes for the best line through each seed, its bearing (rad) and its slope.

    Every other return votes for all lines to which it may belong: a rectangle of bins, whose corners are
    summed up in the end (F. C. Crow, SIGGRAPH 1984).

    Parameters
    ----------
    seeds, points
        Indices of the seeds, and (n, CANDIDATE_FIELDS) returns,.
    """
    out, votes = np.zeros((len(seeds), 3)), np.empty((BEARINGS + 1, SLOPES + 1), np.int32)
    turn, step = math.pi / BEARINGS, 2 * STEEPEST / SLOPES
    for k in range(len(seeds)):
        seed = points[seeds[k]]
        votes[:] = 0
        for j in range(len(points)):
            x, y = points[j, EAST] - seed[EAST], points[j, NORTH] - seed[NORTH]
            away2 = x * x + y * y
            if away2 < NEAREST_M**2 or away2 > FARTHEST_M**2:
                continue
            away = math.sqrt(away2)
            slope = (points[j, UP] - seed[UP]) / away
            if abs(slope) > STEEPEST:
                continue
            bearing = math.atan2(x, y)
            if bearing < 0:
                bearing, slope = bearing + math.pi, -slope
            wide = 2.0 * math.sqrt(seed[SIGMA] ** 2 + points[j, SIGMA] ** 2) / away
            low = max(0, int(np.floor((slope - wide - SAG + STEEPEST) / step)))
            high = min(SLOPES - 1, int(np.floor((slope + wide + SAG + STEEPEST) / step)))
            first, last = int(np.floor((bearing - wide) / turn)), int(np.floor((bearing + wide) / turn))
            while first <= last:
                back = first // BEARINGS * BEARINGS  # beyond half a circle lines rise the other way
                stop = min(last + 1, back + BEARINGS)
                bottom, top = (low, high + 1) if back == 0 else (SLOPES - 1 - high, SLOPES - low)
                votes[first - back, bottom] += 1
                votes[first - back, top] -= 1
                votes[stop - back, bottom] -= 1
                votes[stop - back, top] += 1
                first = stop
        most = 0
        for b in range(BEARINGS):
            row = 0
            for s in range(SLOPES):
                row += votes[b, s]
                votes[b, s] = row + votes[b - 1, s] if b else row
                if votes[b, s] > most:
                    most = votes[b, s]
                    out[k, 1], out[k, 2] = (b + 0.5) * turn, (s + 0.5) * step - STEEPEST
        out[k, 0] = most
    return out


@kernel
def rays_past(
    points: Array2D[np.float64],
    rows: Array1D[np.int64],
    origin: ReadOnly1D[np.uint16],
    origins: ReadOnly2D[np.float64],
    first: int,
    stride: int,
    place: Array1D[np.float64],
    heights: Array1D[np.float64],
    ends: Array1D[np.float64],
    half: float,
    farthest: float,
) -> int:
    """Return how many rays of every `stride`-th row pass a curve within `half` of its height, and go on.

    Parameters
    ----------
    points, rows, origin, origins
        (n, 3) returns, (m,) those used, (n,) the scan of each, and (k, 3) the sensor's position in each scan.
    place, heights, ends
        East, north and direction over ground of the curve; coefficients of its height, a polynomial of second
        degree of the distance along it; and the least and greatest of these distances.
    farthest
        From the sensor to the curve (m).
    """
    count, east, north = 0, place[2], place[3]
    for k in range(first, len(rows), stride):
        i = rows[k]
        o = origins[origin[i]]
        x0, y0 = o[0] - place[0], o[1] - place[1]
        x1, y1 = points[i, 0] - place[0], points[i, 1] - place[1]
        a, b = x0 * north - y0 * east, x1 * north - y1 * east
        if not a * b < 0:  # also NaN
            continue
        share = a / (a - b)
        s = (x0 + share * (x1 - x0)) * east + (y0 + share * (y1 - y0)) * north
        if s < ends[0] or s > ends[1]:
            continue
        dx, dy, dz = points[i, 0] - o[0], points[i, 1] - o[1], points[i, 2] - o[2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        if share * length > farthest or (1 - share) * length < 1.0:
            continue
        z = o[2] + share * dz
        if abs(z - heights[0] - heights[1] * s - heights[2] * s * s) < half:
            count += 1
    return count
