"""Rays of a scan by direction, and how many of them passed, ended in, or ended before a ball."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, ReadOnly2D, Strided1D
from slz.kernels.jit import kernel, kernel_part

ROWS = 90  # of elevation, from straight down
X, Y, Z, RANGE = range(4)  # of a ray: unit vector, length (inf: no return)
HITS, THROUGH, BEFORE = range(3)  # of counts: ended in the ball, reached it (hits too), ended just before it
REFERENCE = 8.0  # length before the ball, in radii, in which returns show the density of the air
SLACK = 1.3  # of the rate at which a measure rises with its angle, within the bounds below it


@kernel
def first_cells() -> Array1D[np.int64]:
    """Return (ROWS + 1,) the number of the first cell of each row of elevation; cells have about one size."""
    first = np.zeros(ROWS + 1, np.int64)
    for row in range(ROWS):
        around = 2 * ROWS * math.cos((row + 0.5) * math.pi / ROWS - math.pi / 2)
        first[row + 1] = first[row] + max(1, int(around + 0.5))
    return first


@kernel_part
def _row(v: float) -> int:
    return min(ROWS - 1, max(0, int((v + 1) / 2 * ROWS)))


@kernel_part
def _diamond(x: float, y: float) -> float:
    """Return an angle's measure, 0 to 4, that rises with it at a rate of 0.5 to 1, without trigonometry."""
    p = y / (abs(x) + abs(y)) if x != 0 or y != 0 else 0.0
    return 2 - p if x < 0 else p if y >= 0 else 4 + p


@kernel_part
def cell_of(first: Array1D[np.int64], x: float, y: float, z: float) -> int:
    """Return the number of the cell of a direction."""
    row = _row(z / (abs(z) + math.sqrt(x * x + y * y)))
    count = int(first[row + 1] - first[row])
    return int(first[row]) + min(count - 1, int(_diamond(x, y) / 4 * count))


@kernel_part
def _ray(x: float, y: float, z: float, out: Strided1D[np.float32]) -> bool:
    """Write a ray to a place relative to the sensor; return whether there is one."""
    length = math.sqrt(x * x + y * y + z * z)
    if not (0 < length < np.inf):  # NaN too
        return False
    out[X], out[Y], out[Z], out[RANGE] = x / length, y / length, z / length, length
    return True


@kernel
def fill_image(
    points: ReadOnly2D[np.float64],
    every: int,
    open_ends: ReadOnly2D[np.float64],
    open_every: int,
    open_weight: int,
    sensor: Strided1D[np.float64],
    first: Array1D[np.int64],
    rays: Array2D[np.float32],
    weights: Array1D[np.int32],
    starts: Array1D[np.int32],
    slots: Array1D[np.int32],
) -> None:
    """Store the rays of a scan sorted by direction.

    Parameters
    ----------
    points, every
        (n, 3) returns; each `every`-th is stored and stands for the others.
    open_ends, open_every, open_weight
        (m, 3) points along rays without a return, how they are thinned, and the rays that each stands for.
    rays, weights, starts
        (4, capacity), (capacity,) and (cells + 1,), changed: the rays, how many each stands for, and where
        those of each cell begin.
    slots
        (n,), changed: where each return's ray is stored, -1 for nowhere.
    """
    cells = len(starts) - 1
    capacity = -(-len(points) // every) + -(-len(open_ends) // open_every)
    own, source = np.empty((capacity, 4), np.float32), np.full(capacity, -1, np.int64)
    weight, cell = np.empty(capacity, np.int32), np.empty(capacity, np.int32)
    slots[:] = -1
    n = 0
    for i in range(0, len(points), every):
        if _ray(points[i, 0] - sensor[0], points[i, 1] - sensor[1], points[i, 2] - sensor[2], own[n]):
            weight[n], source[n] = every, i
            n += 1
    for i in range(0, len(open_ends), open_every):
        x, y, z = open_ends[i, 0] - sensor[0], open_ends[i, 1] - sensor[1], open_ends[i, 2] - sensor[2]
        if _ray(x, y, z, own[n]):
            own[n, RANGE], weight[n] = np.inf, open_weight * open_every
            n += 1
    starts[:] = 0
    for k in range(n):
        cell[k] = cell_of(first, own[k, X], own[k, Y], own[k, Z])
        starts[cell[k] + 1] += 1
    for c in range(cells):
        starts[c + 1] += starts[c]
    filled = starts[:-1].copy()
    for k in range(n):
        at = filled[cell[k]]
        for part in range(4):
            rays[part, at] = own[k, part]
        weights[at] = weight[k]
        if source[k] >= 0:
            slots[source[k]] = at
        filled[cell[k]] += 1


@kernel_part
def _count_range(
    rays: Array2D[np.float32],
    weights: Array1D[np.int32],
    clutter: Array1D[np.int32],
    begin: int,
    end: int,
    place: tuple[np.float32, np.float32, np.float32, np.float32],
    unit: tuple[np.float32, np.float32, np.float32],
    radius: np.float32,
    counts: Array1D[np.float64],
) -> None:
    """Count a range of rays; without branches, so that the compiler makes vectors of it."""
    x, y, z, away = place
    ux, uy, uz = unit
    before_m = np.float32(REFERENCE) * radius
    perp2 = radius * radius - away * away
    hits = through = before = 0
    for i in range(begin, end):
        along = rays[X, i] * x + rays[Y, i] * y + rays[Z, i] * z
        half2 = perp2 + along * along
        half = np.sqrt(max(half2, np.float32(0)))
        near, far, length = along - half, along + half, rays[RANGE, i]
        own = (length == away) & (rays[X, i] == ux) & (rays[Y, i] == uy) & (rays[Z, i] == uz)
        meets = (half2 >= 0) & (along > 0) & ~own
        weight = weights[i]
        through += weight * (meets & (length >= near))
        hits += weight * (meets & (length >= near) & (length <= far))
        before += clutter[i] * (meets & (length < near) & (length >= near - before_m))
    counts[HITS] += hits
    counts[THROUGH] += through
    counts[BEFORE] += before


@kernel_part
def count_in(
    east: float,
    north: float,
    up: float,
    radius: float,
    sensor: Strided1D[np.float64],
    first: Array1D[np.int64],
    rays: Array2D[np.float32],
    weights: Array1D[np.int32],
    clutter: Array1D[np.int32],
    starts: Array1D[np.int32],
    counts: Array1D[np.float64],
) -> None:
    """Add the rays of a scan that ended in a ball, reached it, and ended in the reference length before it.

    `clutter` holds the weights of rays that may have ended in a speck and zero for all others: a solid object
    before the ball must not count as dense air.
    A ray that ends at the ball's centre exactly is the one whose return is judged, and does not count.
    """
    x, y, z = east - sensor[0], north - sensor[1], up - sensor[2]
    away = math.sqrt(x * x + y * y + z * z)
    if not away > radius:  # NaN too
        return
    level = math.sqrt(x * x + y * y)
    v = z / (abs(z) + level)
    wide = SLACK * radius * away / (abs(z) + level) ** 2 if 5 * radius < away else 2.0
    low, high = _row(v - wide), _row(v + wide)
    aside = SLACK * radius * level / (abs(x) + abs(y)) ** 2 if 5 * radius < level else 2.0
    towards = _diamond(x, y)
    place = (np.float32(x), np.float32(y), np.float32(z), np.float32(away))
    unit = (np.float32(x / away), np.float32(y / away), np.float32(z / away))
    for row in range(low, high + 1):
        base, count = int(first[row]), int(first[row + 1] - first[row])
        left = math.floor((towards - aside) / 4 * count)
        right = min(math.floor((towards + aside) / 4 * count), left + count - 1)
        parts = ((max(left, 0), min(right, count - 1)), (left + count, count - 1), (0, right - count))
        for begin, end in parts:
            if begin <= end and begin >= 0 and end < count:
                _count_range(
                    rays, weights, clutter, int(starts[base + begin]), int(starts[base + end + 1]), place,
                    unit, np.float32(radius), counts,
                )  # fmt: skip
