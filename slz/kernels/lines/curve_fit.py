"""Weighted fit of a line over ground and of a parabola of height along it, and growth of such a curve."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.lines.line_votes import SIGMA

EAST, NORTH, ALONG_EAST, ALONG_NORTH, UP, SLOPE, SAG = range(
    7
)  # a point of the line, its direction, the heights
COVARIANCE = 7  # of the heights, 9 numbers
ASIDE_SD, MISFIT, FIELDS = 16, 17, 18
MOST_SAG = 0.02  # 1/m, second coefficient of the height: a span of 20 m that sags 2 m
USUAL_SAG, USUAL_SAG_SD = 0.002, 0.004  # 1/m, before any return: 50 m that sag 1.2 m
LEAST_ASIDE_M = 0.02
GATES = (5.0, 4.0, 3.0, 3.0)  # standard deviations, one after the other
LEAST_SIGMA = 1e-4
FARTHEST_M = 60.0  # of the returns of a curve from the one that it began with
GAP_M = 10.0  # between neighbouring returns of a curve


@kernel
def fit_returns(points: Array2D[np.float64], at: Array1D[np.int64], curve: Array1D[np.float64]) -> bool:
    """Write the curve (FIELDS,) of some of the returns; return False where they have none that hangs.

    Parameters
    ----------
    points
        (n, CANDIDATE_FIELDS) returns, see `slz.kernels.lines.line_votes`.
    at
        Indices of the returns to use, two at least.
    """
    total = east = north = datum = 0.0
    for i in at:
        w = 1.0 / max(points[i, SIGMA], LEAST_SIGMA) ** 2
        total += w
        east += w * points[i, 0]
        north += w * points[i, 1]
        datum += w * points[i, 2]
    east, north, datum = east / total, north / total, datum / total
    xx = xy = yy = 0.0
    for i in at:
        w = 1.0 / max(points[i, SIGMA], LEAST_SIGMA) ** 2
        x, y = points[i, 0] - east, points[i, 1] - north
        xx += w * x * x
        xy += w * x * y
        yy += w * y * y
    angle = 0.5 * math.atan2(2 * xy, xx - yy)  # from east
    if not xx + yy > 0:
        return False
    dx, dy = math.cos(angle), math.sin(angle)
    if dy < 0 or (dy == 0 and dx < 0):
        dx, dy = -dx, -dy
    n = np.zeros((3, 3))
    right = np.zeros(3)
    for i in at:
        w = 1.0 / max(points[i, SIGMA], LEAST_SIGMA) ** 2
        s = (points[i, 0] - east) * dx + (points[i, 1] - north) * dy
        z = points[i, 2] - datum
        n[0, 0] += w
        n[0, 1] += w * s
        n[0, 2] += w * s * s
        n[1, 2] += w * s * s * s
        n[2, 2] += w * s * s * s * s
        right[0] += w * z
        right[1] += w * z * s
        right[2] += w * z * s * s
    n[1, 1] = n[0, 2] + 1e-6
    n[2, 2] += USUAL_SAG_SD**-2
    right[2] += USUAL_SAG * USUAL_SAG_SD**-2
    n[1, 0], n[2, 0], n[2, 1] = n[0, 1], n[0, 2], n[1, 2]
    inverse = np.empty((3, 3))
    det = 0.0
    for r in range(3):
        for c in range(3):
            r1, r2, c1, c2 = (r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3
            inverse[c, r] = n[r1, c1] * n[r2, c2] - n[r1, c2] * n[r2, c1]
        det += n[0, r] * inverse[r, 0]
    if not det > 0:
        return False
    up = slope = sag = 0.0
    for c in range(3):
        up += inverse[0, c] * right[c] / det
        slope += inverse[1, c] * right[c] / det
        sag += inverse[2, c] * right[c] / det
    if sag < 0:
        level = n[0, 0] * n[1, 1] - n[0, 1] * n[0, 1]
        up = (right[0] * n[1, 1] - right[1] * n[0, 1]) / level
        slope = (right[1] * n[0, 0] - right[0] * n[0, 1]) / level
        sag = 0.0
    if sag > MOST_SAG:
        return False
    off2 = 0.0
    for i in at:
        w = 1.0 / max(points[i, SIGMA], LEAST_SIGMA) ** 2
        x, y = points[i, 0] - east, points[i, 1] - north
        s, aside = x * dx + y * dy, y * dx - x * dy
        off = points[i, 2] - datum - up - s * (slope + s * sag)
        off2 += w * (off * off + aside * aside)
    misfit = math.sqrt(off2 / len(at) / 2)
    scale = max(1.0, misfit)
    curve[EAST], curve[NORTH], curve[ALONG_EAST], curve[ALONG_NORTH] = east, north, dx, dy
    curve[UP], curve[SLOPE], curve[SAG] = up + datum, slope, sag
    for r in range(3):
        for c in range(3):
            curve[COVARIANCE + 3 * r + c] = inverse[r, c] / det * scale * scale
    curve[ASIDE_SD], curve[MISFIT] = max(LEAST_ASIDE_M, scale / math.sqrt(total)), misfit
    return True


@kernel_part
def height_variance(curve: Array1D[np.float64], s: float) -> float:
    """Return the variance of the height of a curve (FIELDS,) at a place along it."""
    total, powers = 0.0, (1.0, s, s * s)
    for r in range(3):
        for c in range(3):
            total += powers[r] * powers[c] * curve[COVARIANCE + 3 * r + c]
    return max(0.0, total)


@kernel_part
def _longest_run(s: Array1D[np.float64]) -> Array1D[np.int64]:
    """Return the indices, in order, of the run of places without gaps that holds most of them."""
    order = np.argsort(s, kind="mergesort")
    first = best = 0
    most = 0
    for k in range(len(order)):
        if k and s[order[k]] - s[order[k - 1]] > GAP_M:
            first = k
        if k + 1 - first > most:
            most, best = k + 1 - first, first
    return order[best : best + most].copy()


@kernel
def grow_curve(
    points: Array2D[np.float64],
    free: Array1D[np.bool_],
    seed: int,
    bearing: float,
    slope: float,
    fewest: int,
    curve: Array1D[np.float64],
) -> Array1D[np.int64]:
    """Return the indices of the returns of a curve that grows from a line through a return; empty for none.

    Parameters
    ----------
    points, free
        (n, CANDIDATE_FIELDS) returns, and which may be used.
    seed, bearing, slope
        Return that the line leads through, its bearing from north (rad) and its rise over distance.
    fewest
        Returns of a curve.
    curve
        (FIELDS,) of `fit_returns`, changed.
    """
    dx, dy, n = math.sin(bearing), math.cos(bearing), len(points)
    none = np.empty(0, np.int64)
    pool, at, places = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n)
    n_pool = m = 0
    for i in range(n):
        x, y, z = (
            points[i, 0] - points[seed, 0],
            points[i, 1] - points[seed, 1],
            points[i, 2] - points[seed, 2],
        )
        s, aside = x * dx + y * dy, abs(y * dx - x * dy)
        if not free[i] or abs(s) > FARTHEST_M or aside > 2.0 + 0.05 * abs(s):
            continue
        pool[n_pool] = i
        n_pool += 1
        rise, gate = z - slope * s, GATES[0] * points[i, SIGMA]
        spread = gate + 0.04 * abs(s)
        if aside <= gate + 0.01 * abs(s) and -spread <= rise <= spread + MOST_SAG / 2 * s * s:
            at[m], places[m] = i, s
            m += 1
    for gate in GATES:
        if m < fewest:
            return none
        run = _longest_run(places[:m])
        if len(run) < fewest:
            return none
        kept = np.empty(len(run), np.int64)
        for k in range(len(run)):
            kept[k] = at[run[k]]
        if not fit_returns(points, kept, curve):
            return none
        m = 0
        for k in range(n_pool):
            i = pool[k]
            x, y = points[i, 0] - curve[EAST], points[i, 1] - curve[NORTH]
            s = x * curve[ALONG_EAST] + y * curve[ALONG_NORTH]
            if abs(y * curve[ALONG_EAST] - x * curve[ALONG_NORTH]) > gate * points[i, SIGMA]:
                continue
            off = points[i, 2] - curve[UP] - s * (curve[SLOPE] + s * curve[SAG])
            if off * off <= gate * gate * (points[i, SIGMA] * points[i, SIGMA] + height_variance(curve, s)):
                at[m], places[m] = i, s
                m += 1
    if m < fewest:
        return none
    run = _longest_run(places[:m])
    kept = np.empty(len(run), np.int64)
    for k in range(len(run)):
        kept[k] = at[run[k]]
    if len(run) < fewest or not fit_returns(points, kept, curve):
        return none
    return kept
