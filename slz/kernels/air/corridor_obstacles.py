"""Obstacles in corridors: by bearing the least slope at which a corridor to a point passes over all tops.

Tops of the far map are left out where the near map knows the ground.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.air.seen_columns import bearings_within, passes
from slz.kernels.argument_types import Array1D, Array2D, Strided2D
from slz.kernels.jit import kernel

ROUNDING = 1e-6  # of a near cell, by which sides that coincide may differ
LIFTED_M = 1.0  # by which errors lift returns from far away at most


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
        Height at which corridors begin, see `slz.kernels.air.seen_columns`, and how far they lead.
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


@kernel
def forget_known(
    top: Array2D[np.float32],
    south: float,
    west: float,
    cell: float,
    near_ground: Array2D[np.float32],
    near_south: float,
    near_west: float,
    near_cell: float,
    floor: float,
) -> None:
    """Set tops of a far map over the floor to NaN in the cells in which a near map knows all the ground.

    The far map holds returns from farther away, whose heights an attitude error of 1 degree at 40 m moves by
    0.7 m.

    Parameters
    ----------
    top, near_ground
        (rows, cols) heights of a box of each map (NaN unknown, infinite in a gap that counts as seen: tops
        over it are forgotten up to `LIFTED_M` over the floor); the former is changed.
    south, west, cell, near_south, near_west, near_cell
        Corners of the boxes and sides of the cells (m).
    """
    for r in range(top.shape[0]):
        row0 = int(np.floor((south + r * cell - near_south) / near_cell + ROUNDING))
        row1 = int(np.ceil((south + (r + 1) * cell - near_south) / near_cell - ROUNDING))
        if row0 < 0 or row1 > near_ground.shape[0]:
            continue
        for c in range(top.shape[1]):
            if not top[r, c] > floor:  # NaN too
                continue
            col0 = int(np.floor((west + c * cell - near_west) / near_cell + ROUNDING))
            col1 = int(np.ceil((west + (c + 1) * cell - near_west) / near_cell - ROUNDING))
            known, gap = col0 >= 0 and col1 <= near_ground.shape[1], False
            if known:
                for i in range(row0, row1):
                    for j in range(col0, col1):
                        known &= not np.isnan(near_ground[i, j])
                        gap |= np.isinf(near_ground[i, j])
            if known and not (gap and top[r, c] > floor + LIFTED_M):
                top[r, c] = np.nan
