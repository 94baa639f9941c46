"""Voxel occupancy of what is raised over the floor around the vehicle, and that floor.

Both are stored by index modulo `SIDE`: a column that is farther than others of the same place is forgotten.
"""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D
from slz.kernels.jit import kernel, kernel_part

SIDE = 256  # columns of a row, a power of two
LEVELS = 96  # voxels of a column; heights that differ by a multiple of 48 m share one
VOXEL_M, FLOOR_M = 0.5, 2.0  # sides of a voxel, and of a cell of the floor
AROUND = 1  # cells of the floor to each side in which the ground below is looked for
AGREED_M = 0.7  # between two returns of the floor of a cell
RAISED_M = 1.0  # over the floor, from which voxels are occupied
FAR = 2  # voxels to a second neighbour; a surface holds the first one too
MOST_NEIGHBOURS = 5  # directions in which the air beside a return of a wire is occupied
DIRECTIONS = 24  # across a curve, around it
DOWN = (5 * DIRECTIONS // 8, 7 * DIRECTIONS // 8 + 1)  # the first of them below, and the one behind the last
RING_M = (1.25, 1.75, 2.25, 2.75)  # distances from a curve at which air is looked at
NOWHERE = np.int32(-(2**31))


@kernel
def floor_below(east: float, north: float, lowest: Array3D[np.float32], cell: Array3D[np.int32]) -> float:
    """Return the second-lowest floor of 3 x 3 cells, the only one where there is one; infinite where unknown.

    One cell is no ground: multipath lies below it.
    """
    r0, c0, mask = int(np.floor(north / FLOOR_M)), int(np.floor(east / FLOOR_M)), SIDE - 1
    first = second = np.inf
    for r in range(r0 - AROUND, r0 + AROUND + 1):
        for c in range(c0 - AROUND, c0 + AROUND + 1):
            a, b = r & mask, c & mask
            if cell[a, b, 0] == r and cell[a, b, 1] == c:
                z = float(lowest[a, b, 1])
                if z < first:
                    second, first = first, z
                elif z < second:
                    second = z
    return first if second == np.inf else second


@kernel_part
def height_over_floor(
    east: float, north: float, up: float, lowest: Array3D[np.float32], cell: Array3D[np.int32]
) -> float:
    """Return the height over the floor, infinite where none is known."""
    floor = floor_below(east, north, lowest, cell)
    return up - floor if floor < np.inf else np.inf


@kernel
def add_returns(
    points: Array2D[np.float64],
    rows: Array1D[np.int64],
    ceiling: float,
    raised_m: float,
    epoch: int,
    occupied: Array3D[np.uint8],
    column: Array3D[np.int32],
    lowest: Array3D[np.float32],
    cell: Array3D[np.int32],
    number: int,
    below: Array2D[np.float32],
    known: Array2D[np.int32],
) -> Array1D[np.int64]:
    """Lower the floor to returns, occupy the voxels of those over it, and return those that are raised.

    Where no floor is known, those are that are not below `ceiling`.

    Parameters
    ----------
    points, rows
        (n, 3), and (m,) those of a window, in an order of which the floor depends.
    ceiling
        Height from which a return is no floor: what is as high as the sensor is no ground that it may be
        over.
    raised_m
        Over the floor, `RAISED_M` or more.
    epoch
        Time, 1 to 255.
    occupied, column
        (SIDE, SIDE, LEVELS) epoch of the newest return, 0 for none, and (SIDE, SIDE, 2) rows and columns.
    lowest, cell
        (SIDE, SIDE, 2) the last return below the floor of each cell and that floor, and its row and column.
        Two returns below the floor, one after the other and within `AGREED_M`, are the floor.
    number, below, known
        Number of the window, and (SIDE, SIDE) scratch: the floor below each cell, and the window it is of.
    """
    raised, n, mask = np.empty(len(rows), np.int64), 0, SIDE - 1
    for i in rows:
        z = np.float32(points[i, 2])
        if not z < ceiling:
            continue
        r, c = int(np.floor(points[i, 1] / FLOOR_M)), int(np.floor(points[i, 0] / FLOOR_M))
        a, b = r & mask, c & mask
        if cell[a, b, 0] != r or cell[a, b, 1] != c:
            cell[a, b, 0], cell[a, b, 1] = r, c
            lowest[a, b, 0] = lowest[a, b, 1] = np.float32(np.inf)
        if z < lowest[a, b, 1]:
            before = lowest[a, b, 0]
            lowest[a, b, 0] = z
            if abs(z - before) <= AGREED_M:
                lowest[a, b, 1] = max(z, before)
    for i in rows:
        east, north, up = points[i, 0], points[i, 1], points[i, 2]
        r, c = int(np.floor(north / FLOOR_M)), int(np.floor(east / FLOOR_M))
        a, b = r & mask, c & mask
        if known[a, b] != number:
            known[a, b] = number
            below[a, b] = floor_below(east, north, lowest, cell)
        floor = below[a, b]
        over = up - floor
        if not (over >= RAISED_M if floor < np.inf else up >= ceiling):  # also NaN
            continue
        r, c = int(np.floor(north / VOXEL_M)), int(np.floor(east / VOXEL_M))
        a, b = r & mask, c & mask
        if column[a, b, 0] != r or column[a, b, 1] != c:
            column[a, b, 0], column[a, b, 1] = r, c
            occupied[a, b, :] = 0
        occupied[a, b, int(np.floor(up / VOXEL_M)) % LEVELS] = epoch
        raised[n] = i
        n += over >= raised_m or floor == np.inf
    return raised[:n].copy()


@kernel_part
def is_occupied(
    east: float,
    north: float,
    up: float,
    epoch: int,
    oldest: int,
    occupied: Array3D[np.uint8],
    column: Array3D[np.int32],
) -> bool:
    """Return whether the voxel of a place has held a return since `oldest`; see `occupy`."""
    r, c = int(np.floor(north / VOXEL_M)), int(np.floor(east / VOXEL_M))
    a, b = r & (SIDE - 1), c & (SIDE - 1)
    if column[a, b, 0] != r or column[a, b, 1] != c:
        return False
    at = occupied[a, b, int(np.floor(up / VOXEL_M)) % LEVELS]
    return bool(at != 0 and oldest <= at <= epoch)


@kernel_part
def is_thin_at(
    east: float,
    north: float,
    up: float,
    at: Array2D[np.int64],
    epoch: int,
    oldest: int,
    occupied: Array3D[np.uint8],
    column: Array3D[np.int32],
) -> bool:
    """Return whether a return is not part of a surface or a volume: the air beside it is free.

    Of 26 directions, two voxels in a row are occupied in no more than `MOST_NEIGHBOURS`: a line is continued
    in 2, its noise adds a few; a surface in 8, what has volume in more.

    Parameters
    ----------
    at
        (3, 5) scratch: rows, columns and levels of the voxels from the second before the return on.
    oldest
        Epoch from which on returns count, 1 or more.
    """
    mask, count = SIDE - 1, 0
    for k in range(2 * FAR + 1):
        off = (k - FAR) * VOXEL_M
        at[0, k], at[1, k] = int(np.floor((north + off) / VOXEL_M)), int(np.floor((east + off) / VOXEL_M))
        at[2, k] = int(np.floor((up + off) / VOXEL_M)) % LEVELS
    for x in range(-1, 2):
        for y in range(-1, 2):
            r, c, rr, cc = at[0, FAR + y], at[1, FAR + x], at[0, FAR + FAR * y], at[1, FAR + FAR * x]
            a, b, aa, bb = r & mask, c & mask, rr & mask, cc & mask
            if column[a, b, 0] != r or column[a, b, 1] != c:
                continue
            if column[aa, bb, 0] != rr or column[aa, bb, 1] != cc:
                continue
            for z in range(-1, 2):
                near, far = occupied[a, b, at[2, FAR + z]], occupied[aa, bb, at[2, FAR + FAR * z]]
                held = oldest <= near <= epoch and oldest <= far <= epoch
                count += held and not (x == 0 and y == 0 and z == 0)
    return count <= MOST_NEIGHBOURS


@kernel
def are_thin(
    candidates: Array2D[np.float64],
    epoch: int,
    oldest: int,
    occupied: Array3D[np.uint8],
    column: Array3D[np.int32],
) -> Array1D[np.bool_]:
    """Return (n,) which candidates are thin, see `is_thin_at`."""
    out, scratch = np.empty(len(candidates), np.bool_), np.empty((3, 5), np.int64)
    for i in range(len(out)):
        e, n, u = candidates[i, 0], candidates[i, 1], candidates[i, 2]
        out[i] = is_thin_at(e, n, u, scratch, epoch, oldest, occupied, column)
    return out


@kernel
def around_curve(
    s: Array1D[np.float64],
    place: Array1D[np.float64],
    along: Array1D[np.float64],
    heights: Array1D[np.float64],
    held: Array2D[np.int64],
    above: Array2D[np.int64],
    below: Array2D[np.float64],
    epoch: int,
    oldest: int,
    occupied: Array3D[np.uint8],
    column: Array3D[np.int32],
    lowest: Array3D[np.float32],
    cell: Array3D[np.int32],
) -> int:
    """Count the voxels around places of a curve that are high over the floor, and those that are occupied.

    High is `RAISED_M` and half a voxel over it, or over no floor. Direction 0 is to the right, a quarter of
    them further is up.

    Parameters
    ----------
    s, place, along, heights
        Places along the curve, as far apart as voxels, and the curve of `slz.wires.detected_wire`.
    held, above
        (DIRECTIONS, rings), zero, changed.
    below
        (n, 3), n at least the number of voxels in the directions `DOWN`: receives the places of those that
        are high and not occupied.

    Returns
    -------
    Number of the last.
    """
    rings, n, mask = len(RING_M), 0, SIDE - 1
    ways, places, at = np.empty((3, held.size)), np.empty((3, held.size)), np.empty((3, held.size), np.int32)
    for q in range(held.size):
        angle, ring = 2 * math.pi / DIRECTIONS * (q // rings), RING_M[q % rings]
        ways[0, q], ways[1, q] = ring * np.cos(angle) * along[1], -(ring * np.cos(angle) * along[0])
        ways[2, q] = ring * np.sin(angle)
    for i in range(len(s)):
        east, north = place[0] + s[i] * along[0], place[1] + s[i] * along[1]
        up = heights[0] + s[i] * (heights[1] + s[i] * heights[2])
        floor = floor_below(east, north, lowest, cell)
        least = -np.inf if floor == np.inf else floor + RAISED_M + VOXEL_M / 2
        for axis, middle in enumerate((east, north, up)):
            for q in range(held.size):  # vectorised
                places[axis, q] = middle + ways[axis, q]
                at[axis, q] = np.int32(np.floor(places[axis, q] / VOXEL_M))
        for q in range(held.size):
            if not places[2, q] >= least:
                continue
            d, k, c, r = q // rings, q % rings, at[0, q], at[1, q]
            above[d, k] += 1
            a, b, known = r & mask, c & mask, np.uint8(0)
            if column[a, b, 0] == r and column[a, b, 1] == c:
                known = occupied[a, b, at[2, q] % LEVELS]
            if oldest <= known <= epoch:
                held[d, k] += 1
            elif DOWN[0] <= d < DOWN[1]:
                below[n, 0], below[n, 1], below[n, 2] = places[0, q], places[1, q], places[2, q]
                n += 1
    return n


@kernel
def vacate(curve: Array2D[np.float64], occupied: Array3D[np.uint8], column: Array3D[np.int32]) -> None:
    """Make the voxels at the places (n, 3) of a curve, and those beside them, unoccupied."""
    for i in range(len(curve)):
        row, col = int(np.floor(curve[i, 1] / VOXEL_M)), int(np.floor(curve[i, 0] / VOXEL_M))
        level = int(np.floor(curve[i, 2] / VOXEL_M))
        for r in range(row - 1, row + 2):
            for c in range(col - 1, col + 2):
                a, b = r & (SIDE - 1), c & (SIDE - 1)
                if column[a, b, 0] == r and column[a, b, 1] == c:
                    for up in range(-1, 2):
                        occupied[a, b, (level + up) % LEVELS] = 0


@kernel
def first_support(
    curve: Array2D[np.float64],
    epoch: int,
    oldest: int,
    occupied: Array3D[np.uint8],
    column: Array3D[np.int32],
    lowest: Array3D[np.float32],
    cell: Array3D[np.int32],
    least: float,
) -> int:
    """Return the index of the first place of a curve at which something carries it or it meets the ground.

    A support is occupied below the curve in three voxels of four, beginning with the one 1 m below, within a
    voxel to each side. Negative, minus one and minus the index, where the ground comes nearer than `least`.
    The number of places where there is neither.
    """
    for i in range(len(curve)):
        e, n, u = curve[i]
        if u < floor_below(e, n, lowest, cell) + least and floor_below(e, n, lowest, cell) < np.inf:
            return -1 - i
        held = 0
        for down in range(4):
            found = False
            for x in range(-1, 2):
                for y in range(-1, 2):
                    found |= is_occupied(
                        e + x * VOXEL_M,
                        n + y * VOXEL_M,
                        u - 1.0 - down * VOXEL_M,
                        epoch,
                        oldest,
                        occupied,
                        column,
                    )
            held += found
        if held >= 3:
            return i
    return len(curve)
