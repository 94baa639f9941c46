"""DEM cells from radar samples, and fusion of several DEMs with phase ambiguities."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Strided1D, Strided2D, Strided3D
from slz.kernels.jit import kernel

SUM_WEIGHT, SUM_HEIGHT, SUM_SQUARE, SUM_VARIANCE, SUM_TURN = range(5)
DEM_SUMS = 5
BEAM_PARTS = 3  # points along the beam that represent a sample
TURNS = 2  # whole turns of the phase that an observation may be off by
CAP = 16.0  # bound on a squared deviation, in variances
RIVAL = 9.0  # margin in cost of the best height over any other


@kernel
def add_samples(
    points: Strided2D[np.float64],
    sigma: Strided1D[np.float64],
    turn: Strided1D[np.float64],
    ahead: Strided1D[np.float64],
    azimuth: float,
    west: float,
    south: float,
    cell: float,
    sums: Strided3D[np.float64],
) -> None:
    """Add samples to the cells under their beam: sums of weight, height, its square, variance and turn."""
    rows, cols = sums.shape[:2]
    for i in range(len(points)):
        weight = 1.0 / (sigma[i] * sigma[i])
        for part in range(BEAM_PARTS):
            along = azimuth * ((part + 0.5) / BEAM_PARTS - 0.5)
            c = int(np.floor((points[i, 0] + along * ahead[0] - west) / cell))
            r = int(np.floor((points[i, 1] + along * ahead[1] - south) / cell))
            if r < 0 or c < 0 or r >= rows or c >= cols:
                continue
            z = points[i, 2]
            sums[r, c, SUM_WEIGHT] += weight
            sums[r, c, SUM_HEIGHT] += weight * z
            sums[r, c, SUM_SQUARE] += weight * z * z
            sums[r, c, SUM_VARIANCE] += 1.0
            sums[r, c, SUM_TURN] += weight * turn[i]


@kernel
def fuse_cells(
    height: Strided3D[np.float64],
    sigma: Strided3D[np.float64],
    turn: Strided3D[np.float64],
    least: int,
    most_apart: float,
    out_height: Strided2D[np.float64],
    out_sigma: Strided2D[np.float64],
) -> None:
    """Fuse observations (k, rows, cols) of each cell by weight; NaN where the height is ambiguous.

    Each observation may be off by whole turns of its phase. Every height that any observation allows is a
    candidate. Its cost is the sum over the observations of the squared distance, in variances, to the nearest
    height that the observation allows, plus one for each turn. The best must lead by `RIVAL` over every
    candidate more than `most_apart` away, and `least` observations must agree with it; else the cell is
    unknown. The scatter of the agreeing observations raises the standard deviation.
    """
    n, rows, cols = height.shape
    for r in range(rows):
        for c in range(cols):
            out_height[r, c], out_sigma[r, c] = np.nan, np.nan
            there = 0
            for k in range(n):
                there += not np.isnan(height[k, r, c])
            if there < least:
                continue
            best, best_cost = np.nan, np.inf
            for k in range(n):
                for t in range(-TURNS, TURNS + 1):
                    z = height[k, r, c] + t * turn[k, r, c]
                    if np.isnan(z):
                        continue
                    cost = 0.0
                    for other in range(n):
                        h = height[other, r, c]
                        if np.isnan(h):
                            continue
                        off = (z - h) / turn[other, r, c]
                        turns = min(max(np.floor(off + 0.5), -TURNS), TURNS)
                        away = (z - h - turns * turn[other, r, c]) / sigma[other, r, c]
                        cost += min(away * away, CAP) + abs(turns)
                    if cost < best_cost:
                        best, best_cost = z, cost
            weight = total = square = 0.0
            agree = 0
            for k in range(n):
                h = height[k, r, c]
                if np.isnan(h):
                    continue
                turns = min(max(np.floor((best - h) / turn[k, r, c] + 0.5), -TURNS), TURNS)
                h += turns * turn[k, r, c]
                w = 1.0 / sigma[k, r, c] ** 2
                if (h - best) ** 2 * w > CAP:
                    continue
                agree += 1
                weight += w
                total += w * h
                square += w * h * h
            if agree < least:
                continue
            mean = total / weight
            rival = np.inf
            if there > 1:
                for k in range(n):
                    for t in range(-TURNS, TURNS + 1):
                        z = height[k, r, c] + t * turn[k, r, c]
                        if np.isnan(z) or abs(z - mean) <= most_apart:
                            continue
                        cost = 0.0
                        for other in range(n):
                            h = height[other, r, c]
                            if np.isnan(h):
                                continue
                            turns = min(max(np.floor((z - h) / turn[other, r, c] + 0.5), -TURNS), TURNS)
                            away = (z - h - turns * turn[other, r, c]) / sigma[other, r, c]
                            cost += min(away * away, CAP) + abs(turns)
                        rival = min(rival, cost)
            if rival - best_cost < RIVAL:
                continue
            out_height[r, c] = mean
            scatter = max(0.0, square / weight - mean * mean)
            out_sigma[r, c] = np.sqrt(1.0 / weight + scatter / max(1, agree - 1))
