"""Horizon of a point: greatest elevation angle by bearing."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Strided1D, Strided2D
from slz.kernels.jit import kernel


@kernel
def horizon(
    top: Strided2D[np.float32],
    row: float,
    col: float,
    base_m: float,
    cell_m: float,
    near_m: float,
    far_m: float,
    sectors: int,
    to_east: float,
    to_north: float,
) -> Strided1D[np.float64]:
    """Return by sector the greatest elevation angle (rad) of a top seen from a point; NaN where unknown.

    Sectors are bearings, clockwise from north, the first centred on north. Only cells between `near_m` and
    `far_m` from the point count, each in all the sectors that it spans. With a unit direction, only the
    sectors within 20 degrees of it are computed; with 0, 0 all.
    """
    out = np.full(sectors, np.nan)  # tangents of the angles
    width = 2 * np.pi / sectors
    # A cell spans at most 15 degrees to either side; a sector ends 5 degrees beyond its middle.
    ahead = 0.75 if to_east != 0 or to_north != 0 else -2.0
    middle, lowest = min(max(np.int64(row), 0), top.shape[0] - 1), -np.inf
    for i in range(2 * top.shape[0]):  # outwards, because near tops hide most of the far ones
        r = middle + (i + 1) // 2 if i % 2 else middle - i // 2
        if r < 0 or r >= top.shape[0]:
            continue
        for c in range(top.shape[1]):
            z = top[r, c]
            east, north = (c - col) * cell_m, (r - row) * cell_m
            distance = np.sqrt(east * east + north * north)
            tangent = (z - base_m) / distance
            if np.isnan(z) or distance < near_m or distance > far_m or tangent <= lowest:
                continue
            if distance > 2 * cell_m and east * to_east + north * to_north < ahead * distance:
                continue
            bearing = np.arctan2(east, north)
            half = np.arcsin(min(1.0, 0.5 * cell_m / max(distance, 1e-9)))
            first = int(np.floor((bearing - half) / width + 0.5))
            last = int(np.floor((bearing + half) / width + 0.5))
            for s in range(first, last + 1):
                k = s % sectors
                if np.isnan(out[k]) or tangent > out[k]:
                    out[k] = tangent
        least = out.min()
        lowest = -np.inf if np.isnan(least) else least
    return np.asarray(np.arctan(out))
