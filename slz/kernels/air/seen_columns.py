"""Columns of air: voxels that rays passed, around the vehicle."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D, ReadOnly1D, ReadOnly2D
from slz.kernels.jit import kernel, kernel_part

SIDE = 256  # columns of a row, a power of two: the column of a place is its index modulo SIDE
LEVELS = 64  # voxels of a column
BELOW = 16  # of them, below the return whose ray was the first to pass the column
ROW, COL, BASE = range(3)  # of a column: its indices, and the level of its lowest voxel
NOWHERE = np.int32(-(2**31))
MOST_COUNT = 255
STEP = 0.5  # voxels
SHORT_M = 0.05  # a ray is followed up to this far before its return


@kernel_part
def passes(along: float, aside: float, radius: float, spread: float) -> tuple[float, float]:
    """Return the least and greatest distance to the point at which the disc covers a place; not below 0.

    along, aside: coordinates of the place from the point, along the way and across it (m). The first is
    greater than the second where the disc never covers it.
    """
    b, a = along + spread * radius, 1 - spread * spread
    root2 = b * b - a * (along * along + aside * aside - radius * radius)
    if root2 < 0:
        return 1.0, 0.0
    root = np.sqrt(root2)
    if b + root < 0:
        return 1.0, 0.0
    return max(0.0, (b - root) / a), (b + root) / a


@kernel_part
def bearings_within(away: float, radius: float, spread: float, width: float) -> int:
    """Return how many steps of `width` (rad) to each side corridors may cover a place so far `away`."""
    nearest = (away - radius) / (1 + spread)  # of the vehicle to the point, when it covers the place
    sine = 1.0 if nearest <= 0 else min(1.0, radius / nearest + spread)
    return int(min(np.ceil((np.pi if sine == 1.0 else np.arcsin(sine)) / width), np.floor(np.pi / width)))


@kernel
def follow_rays(
    points: Array2D[np.float64],
    rows: Array1D[np.int64],
    origin: ReadOnly1D[np.uint16],
    origins: ReadOnly2D[np.float64],
    first: int,
    stride: int,
    voxel: float,
    passed: Array3D[np.uint8],
    column: Array3D[np.int32],
) -> None:
    """Count in each voxel the rays that passed it, each of every `stride`-th row for all of them.

    Parameters
    ----------
    points, rows, origin, origins
        (n, 3) returns, (m,) those used, (n,) the scan of each, and (k, 3) the sensor's position in each scan.
    voxel
        Edge of a voxel (m).
    passed, column
        (SIDE, SIDE, LEVELS) counts up to 255, and (SIDE, SIDE, 3) which column they are of; a column that
        is farther than others of the same place is forgotten.
    """
    weight, mask = min(stride, MOST_COUNT), SIDE - 1
    away = np.arange(SIDE / STEP + 3) * STEP * voxel
    share, at, last = np.empty(len(away)), np.empty((3, len(away)), np.int32), np.empty(len(away), np.int32)
    for j in range(first, len(rows), stride):
        i = rows[j]
        o = origins[origin[i]]
        x, y, z = points[i, 0] - o[0], points[i, 1] - o[1], points[i, 2] - o[2]
        length = np.sqrt(x * x + y * y + z * z)
        if not SHORT_M < length < np.inf:  # NaN neither; what a processor makes an integer of it differs
            continue
        steps = int(min(length, SIDE * voxel) / (STEP * voxel)) + 1
        ground = int(np.floor(points[i, 2] / voxel))
        own_row, own_col = int(np.floor(o[1] / voxel)), int(np.floor(o[0] / voxel))
        end = length - SHORT_M
        for k in range(steps + 1):  # vectorised, as the next
            share[k] = (away[k] if away[k] < end else end) / length
        for axis, (start, way) in enumerate(((o[1], y), (o[0], x), (o[2], z))):
            for k in range(steps + 1):
                at[axis, k] = np.int32(np.floor((start + way * share[k]) / voxel))
        n = 0  # of the voxels; no branch, as neither is likelier
        for k in range(steps):
            last[n] = k
            n += (at[0, k] != at[0, k + 1]) | (at[1, k] != at[1, k + 1]) | (at[2, k] != at[2, k + 1])
        last[n] = steps
        for k in last[: n + 1]:
            r, c, level = at[0, k], at[1, k], at[2, k]
            if abs(r - own_row) >= SIDE // 2 or abs(c - own_col) >= SIDE // 2:
                break
            a, b = r & mask, c & mask
            if column[a, b, ROW] != r or column[a, b, COL] != c:
                column[a, b, ROW], column[a, b, COL], column[a, b, BASE] = r, c, ground - BELOW
                passed[a, b, :] = 0
            up = level - column[a, b, BASE]
            if 0 <= up < LEVELS:
                passed[a, b, up] = min(MOST_COUNT, int(passed[a, b, up]) + weight)


@kernel
def rays_through(
    points: Array2D[np.float64], voxel: float, passed: Array3D[np.uint8], column: Array3D[np.int32]
) -> Array1D[np.uint8]:
    """Return (n,) rays that passed the voxels of points (n, 3); see `follow_rays`."""
    out, mask = np.zeros(len(points), np.uint8), SIDE - 1
    for i in range(len(points)):
        r, c = int(np.floor(points[i, 1] / voxel)), int(np.floor(points[i, 0] / voxel))
        a, b = r & mask, c & mask
        if column[a, b, ROW] == r and column[a, b, COL] == c:
            up = int(np.floor(points[i, 2] / voxel)) - column[a, b, BASE]
            if 0 <= up < LEVELS:
                out[i] = passed[a, b, up]
    return out


@kernel_part
def mark_unseen_lines(
    passed: Array3D[np.uint8],
    column: Array3D[np.int32],
    voxel: float,
    east: float,
    north: float,
    floor: float,
    ceiling: float,
    tangents: ReadOnly1D[np.float64],
    reach: float,
    fewest: int,
    unseen: Array2D[np.bool_],
) -> None:
    """Mark the bearings and slopes whose middle line leads through a voxel that too few rays passed.

    It is a part of the corridor, which need not be looked at then; see `unseen_slopes` for the parameters.
    """
    bearings, mask = unseen.shape[0], SIDE - 1
    for k in range(bearings):
        eastward, northward = np.sin(2 * np.pi * k / bearings), np.cos(2 * np.pi * k / bearings)
        for s in range(len(tangents)):
            away = 0.0
            while not unseen[k, s] and tangents[s] != np.inf and away <= reach:
                height = floor + away * tangents[s]
                if height >= ceiling:
                    break
                r = int(np.floor((north + away * northward) / voxel))
                c = int(np.floor((east + away * eastward) / voxel))
                a, b = r & mask, c & mask
                level = int(np.floor(height / voxel)) - int(column[a, b, BASE])
                known = column[a, b, ROW] == r and column[a, b, COL] == c
                unseen[k, s] = not (known and 0 <= level < LEVELS and passed[a, b, level] >= fewest)
                away += voxel


@kernel
def unseen_slopes(
    passed: Array3D[np.uint8],
    column: Array3D[np.int32],
    voxel: float,
    east: float,
    north: float,
    floor: float,
    ceiling: float,
    tangents: ReadOnly1D[np.float64],
    radius: float,
    spread: float,
    height: float,
    reach: float,
    fewest: int,
    unseen: Array2D[np.bool_],
) -> None:
    """Mark the bearings and slopes of corridors to a point in which a voxel was passed by too few rays.

    Parameters
    ----------
    tangents, radius, spread, height
        See `slz.kernels.air.seen_columns`; an infinite tangent is straight up.
    floor, ceiling, reach
        Height at which corridors begin and end, and how far they lead.
    unseen
        (bearings, slopes), marked True; what is marked already is not looked at.
    """
    bearings, half, mask = unseen.shape[0], voxel * np.sqrt(0.5), SIDE - 1
    width = 2 * np.pi / bearings
    cells = int(min(np.ceil(reach / voxel), SIDE // 2 - 1))
    row, col = int(np.floor(north / voxel)), int(np.floor(east / voxel))
    top = int(np.floor(ceiling / voxel))
    mark_unseen_lines(
        passed,
        column,
        voxel,
        east,
        north,
        floor,
        ceiling,
        tangents,
        min(reach, cells * voxel),
        fewest,
        unseen,
    )
    left, farthest = np.zeros(bearings, np.int64), 0.0
    for k in range(bearings):
        for s in range(len(tangents)):
            if not unseen[k, s]:
                left[k] += 1
                level = 0.0 if tangents[s] == np.inf else max(0.0, ceiling - floor) / tangents[s]
                farthest = max(farthest, level + radius + spread * level)
    if left.sum() == 0:
        return
    reach = min(reach, farthest)
    cells = min(cells, int(np.ceil((reach + half) / voxel)) + 1)
    for r in range(row - cells, row + cells + 1):
        for c in range(col - cells, col + cells + 1):
            x, y = (c + 0.5) * voxel - east, (r + 0.5) * voxel - north
            away = np.sqrt(x * x + y * y)
            if away - half > reach:
                continue
            a, b = r & mask, c & mask
            known = column[a, b, ROW] == r and column[a, b, COL] == c
            base = int(column[a, b, BASE])
            lowest = int(np.floor(floor / voxel)) - base
            highest = lowest - 1  # of the levels seen without a gap
            if known and lowest >= 0:
                while highest < top - base and highest + 1 < LEVELS and passed[a, b, highest + 1] >= fewest:
                    highest += 1
            if highest >= top - base:
                continue
            steps, bearing = bearings_within(away, radius + half, spread, width), np.arctan2(x, y)
            towards = int(np.floor(bearing / width + 0.5))
            for k in range(towards - steps, towards + steps + 1):
                if left[k % bearings] == 0:
                    continue
                turn = k * width - bearing
                near, far = passes(away * np.cos(turn), away * np.sin(turn), radius + half, spread)
                if not near <= far:
                    continue
                for s in range(len(tangents)):
                    if unseen[k % bearings, s]:
                        continue
                    if tangents[s] == np.inf:
                        if near > 0:
                            continue
                        low, high = floor, ceiling
                    else:
                        low = floor + near * tangents[s]
                        if low >= ceiling:
                            continue
                        high = min(ceiling, floor + far * tangents[s] + height)
                    first, last = int(np.floor(low / voxel)) - base, int(np.floor(high / voxel)) - base
                    seen = known and first >= 0 and last < LEVELS
                    if seen and not (lowest <= first and last <= highest):
                        for level in range(first, last + 1):
                            seen &= passed[a, b, level] >= fewest
                    if not seen:
                        unseen[k % bearings, s] = True
                        left[k % bearings] -= 1
