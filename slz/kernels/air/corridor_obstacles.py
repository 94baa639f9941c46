"""Obstacles in corridors: by bearing the least slope at which a corridor to a point passes over all tops."""

from __future__ import annotations

import numpy as np

from slz.kernels.air.swept_disc import bearings_within, passes
from slz.kernels.argument_types import Array1D, Array2D, Strided2D
from slz.kernels.jit import kernel


@kernel
def clear_over(
    top: Strided2D[np.float32],
    safe: Strided2D[np.bool_],
    south: float,
    west: float,
    cell: float,
    east: float,
    north: float,
    floor: float,
    radius: float,
    spread: float,
    reach: float,
    least: float,
    tangents: Array1D[np.float64],
    highest: Array2D[np.float64],
) -> None:
    """Raise the tangents of the slopes at which corridors pass over the tops of a map's box.

    What is higher than the floor within the radius at the point blocks all, unless its cell is safe.

    Parameters
    ----------
    top, safe
        (rows, cols) heights (NaN unknown), and whether the vehicle can land there.
    south, west
        Corner of the box (m).
    floor, radius, spread, reach
        Height at which corridors begin, see `slz.kernels.air.swept_disc`, and how far they lead.
    least
        Tangent of the least slope that matters; tops that no corridor of it meets are skipped.
    tangents, highest
        (bearings,) raised, infinite where nothing passes; (bearings, 3) place and height of the top which
        asks for them.
    """
    bearings, half = len(tangents), cell * np.sqrt(0.5)
    width = 2 * np.pi / bearings
    for r in range(top.shape[0]):
        for c in range(top.shape[1]):
            rise = top[r, c] - floor
            if not rise > 0:  # NaN too
                continue
            x, y = west + (c + 0.5) * cell - east, south + (r + 0.5) * cell - north
            away = np.sqrt(x * x + y * y)
            within = away <= radius + half
            if away - half > reach or (within and safe[r, c]):
                continue
            if rise < least * (away - radius - half) / (1 + spread):  # below all corridors
                continue
            steps, bearing = bearings_within(away, radius + half, spread, width), np.arctan2(x, y)
            towards = int(np.floor(bearing / width + 0.5))
            for k in range(towards - steps, towards + steps + 1):
                turn, b = k * width - bearing, k % bearings
                near, far = passes(away * np.cos(turn), away * np.sin(turn), radius + half, spread)
                if not near <= far:
                    continue
                tangent = rise / near if near > 0 and not within else np.inf
                if tangent > max(least, tangents[b]):
                    tangents[b] = tangent
                    highest[b, 0], highest[b, 1], highest[b, 2] = east + x, north + y, top[r, c]
