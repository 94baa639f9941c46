"""Kernels for the nearest obstacle in each sector around the vehicle."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D
from slz.kernels.jit import kernel


@kernel
def mark_returns(
    points: Array2D[np.float64],
    min_m: float,
    max_m: float,
    low: float,
    high: float,
    nearest: Array1D[np.float64],
    free: Array1D[np.bool_],
) -> None:
    """Lower the distances of the sectors that contain returns, and mark those that a ray passed through.

    Parameters
    ----------
    points
        (n, 3) forward, right, down; NaN is ignored.
    min_m, max_m, low, high
        Range of horizontal distances, and height band (down positive), which includes the vehicle's height 0.
    nearest, free
        (sectors,) m and bool; changed. Sector 0 is centred on forward, the next ones follow clockwise.
    """
    width = 2 * math.pi / len(nearest)
    for i in range(len(points)):
        forward, right, down = points[i]
        reach = math.sqrt(forward * forward + right * right)
        if not (reach >= min_m) or math.isnan(down):
            continue
        if reach > max_m:
            # A ray from the vehicle to a far return is at down / reach * max_m when it passes max_m.
            if down * max_m <= high * reach and down * max_m >= low * reach:
                free[int(np.rint(math.atan2(right, forward) / width)) % len(nearest)] = True
        elif low <= down <= high:
            sector = int(np.rint(math.atan2(right, forward) / width)) % len(nearest)
            nearest[sector] = min(nearest[sector], reach)


@kernel
def mark_columns(
    columns: Array2D[np.float64],
    half_m: float,
    min_m: float,
    max_m: float,
    high: float,
    nearest: Array1D[np.float64],
) -> None:
    """Lower the distances of all sectors that contain map cells, solid from the ground to their tops.

    Parameters
    ----------
    columns
        (n, 3) forward and right of the cells' centres, and down of their tops.
    half_m
        Half a cell's side. The vehicle's own cell does not count: it would fill every direction.
    min_m, max_m, high, nearest
        See `mark_returns`; nearer edges count as `min_m`.
    """
    width = 2 * math.pi / len(nearest)
    for i in range(len(columns)):
        forward, right, down = columns[i]
        inside = abs(forward) <= half_m and abs(right) <= half_m
        reach = math.sqrt(forward * forward + right * right)
        if inside or not (down <= high) or not (reach - half_m <= max_m):
            continue
        bearing = math.atan2(right, forward)
        spread = math.asin(min(1.0, half_m / reach))
        first = math.floor((bearing - spread) / width + 0.5)
        last = math.floor((bearing + spread) / width + 0.5)
        for sector in range(first, last + 1):
            at = sector % len(nearest)
            nearest[at] = min(nearest[at], max(min_m, reach - half_m))
