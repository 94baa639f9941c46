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
DIRECTIONS = 24  # across a curve, around it
RING_M = (1.25, 1.75, 2.25, 2.75)  # distances from a curve at which air is looked at
LOW, FREE, HELD = range(3)  # of a place: too near to the floor, not occupied, occupied
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


@kernel
def heights_over_floor(
    points: Array2D[np.float64],
    ceiling: float,
    lowest: Array3D[np.float32],
    cell: Array3D[np.int32],
    number: int,
    below: Array2D[np.float32],
    known: Array2D[np.int32],
) -> Array1D[np.float64]:
    """Lower the floor to the returns (n, 3) of a window, and return their heights over it.

    Where no floor is known they are infinite from `ceiling` on, and NaN below.

    Parameters
    ----------
    ceiling
        Height from which a return is no floor: what is as high as the sensor is no ground that it may be
        over.
    lowest, cell
        (SIDE, SIDE, 2) the last return below the floor of each cell and that floor, and its row and column.
        Two returns below the floor, one after the other and within `AGREED_M`, are the floor.
    number, below, known
        Number of the window, and (SIDE, SIDE) scratch: the floor below each cell, and the window it is of.
    """
    out, mask = np.empty(len(points)), SIDE - 1
    for i in range(len(points)):
        r, c = int(np.floor(points[i, 1] / FLOOR_M)), int(np.floor(points[i, 0] / FLOOR_M))
        a, b, z = r & mask, c & mask, np.float32(points[i, 2])
        if not z < ceiling:
            continue
        if cell[a, b, 0] != r or cell[a, b, 1] != c:
            cell[a, b, 0], cell[a, b, 1] = r, c
            lowest[a, b, 0] = lowest[a, b, 1] = np.float32(np.inf)
        if z < lowest[a, b, 1]:
            before = lowest[a, b, 0]
            lowest[a, b, 0] = z
            if abs(z - before) <= AGREED_M:
                lowest[a, b, 1] = max(z, before)
    for i in range(len(points)):
        r, c = int(np.floor(points[i, 1] / FLOOR_M)), int(np.floor(points[i, 0] / FLOOR_M))
        a, b = r & mask, c & mask
        if known[a, b] != number:
            known[a, b] = number
            below[a, b] = floor_below(points[i, 0], points[i, 1], lowest, cell)
        floor = below[a, b]
        if floor < np.inf:
            out[i] = points[i, 2] - floor
        else:
            out[i] = np.inf if points[i, 2] >= ceiling else np.nan
    return out


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


@kernel
def occupy(
    points: Array2D[np.float64],
    over: Array1D[np.float64],
    epoch: int,
    occupied: Array3D[np.uint8],
    column: Array3D[np.int32],
) -> None:
    """Occupy the voxels of the returns that are `RAISED_M` over the floor.

    Parameters
    ----------
    points, over
        (n, 3) returns, and their heights over the floor.
    epoch
        Time, 1 to 255.
    occupied, column
        (SIDE, SIDE, LEVELS) epoch of the newest return, 0 for none, and (SIDE, SIDE, 2) rows and columns.
    """
    mask = SIDE - 1
    for i in range(len(points)):
        if not over[i] >= RAISED_M:  # also NaN
            continue
        r, c = int(np.floor(points[i, 1] / VOXEL_M)), int(np.floor(points[i, 0] / VOXEL_M))
        a, b = r & mask, c & mask
        if column[a, b, 0] != r or column[a, b, 1] != c:
            column[a, b, 0], column[a, b, 1] = r, c
            occupied[a, b, :] = 0
        occupied[a, b, int(np.floor(points[i, 2] / VOXEL_M)) % LEVELS] = epoch


@kernel
def neighbour_directions(
    points: Array2D[np.float64],
    epoch: int,
    oldest: int,
    occupied: Array3D[np.uint8],
    column: Array3D[np.int32],
    enough: int,
) -> Array1D[np.int64]:
    """Return (n,) in how many of 26 directions two voxels in a row beside each point are occupied.

    A line is continued in 2, its noise adds a few; a surface in 8, what has volume in more. `enough`: number
    at which counting ends.
    """
    out = np.zeros(len(points), np.int64)
    place = (epoch, oldest, occupied, column)
    for i in range(len(points)):
        for x in range(-1, 2):
            for y in range(-1, 2):
                for z in range(-1, 2):
                    if out[i] >= enough or (x == 0 and y == 0 and z == 0):
                        continue
                    dx, dy, dz = x * VOXEL_M, y * VOXEL_M, z * VOXEL_M
                    e, n, u = points[i]
                    if is_occupied(e + FAR * dx, n + FAR * dy, u + FAR * dz, *place) and is_occupied(
                        e + dx, n + dy, u + dz, *place
                    ):
                        out[i] += 1
    return out


@kernel
def around_curve(
    curve: Array2D[np.float64],
    east: float,
    north: float,
    epoch: int,
    oldest: int,
    occupied: Array3D[np.uint8],
    column: Array3D[np.int32],
    lowest: Array3D[np.float32],
    cell: Array3D[np.int32],
) -> tuple[Array2D[np.float64], Array3D[np.uint8]]:
    """Return the places around those of a curve, (n x DIRECTIONS x rings, 3), and what is known of them.

    The second is (n, DIRECTIONS, rings): `LOW` for what is lower than `RAISED_M` and half a voxel over the
    floor, `HELD` for an occupied voxel, `FREE` for another. Direction 0 is to the right, a quarter of them
    further is up.

    Parameters
    ----------
    curve
        (n, 3) places, as far apart as voxels.
    east, north
        Direction of the curve over ground.
    """
    rings = len(RING_M)
    places = np.empty((len(curve) * DIRECTIONS * rings, 3))
    known = np.zeros((len(curve), DIRECTIONS, rings), np.uint8)
    angles = 2 * math.pi / DIRECTIONS * np.arange(DIRECTIONS)
    asides, ups = np.cos(angles), np.sin(angles)
    n = 0
    for i in range(len(curve)):
        floor = floor_below(curve[i, 0], curve[i, 1], lowest, cell)
        for d in range(DIRECTIONS):
            aside, up = asides[d], ups[d]
            for k in range(rings):
                x, y = curve[i, 0] + RING_M[k] * aside * north, curve[i, 1] - RING_M[k] * aside * east
                z = curve[i, 2] + RING_M[k] * up
                places[n, 0], places[n, 1], places[n, 2] = x, y, z
                n += 1
                if z >= floor + RAISED_M + VOXEL_M / 2 or floor == np.inf:
                    held = is_occupied(x, y, z, epoch, oldest, occupied, column)
                    known[i, d, k] = HELD if held else FREE
    return places, known


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
