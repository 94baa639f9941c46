"""Clutter: ground and rays around isolated returns, and the chance that clutter alone explains them."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array2D, Array3D, Array5D, Strided2D
from slz.kernels.cells.cell_record import (
    BOTTOM,
    COUNT,
    EXCESS,
    HEIGHT,
    MEAN,
    SPREAD,
    TILE,
    TOP,
    WEIGHT,
)
from slz.kernels.cells.tile_directory import Directory, slot_at
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.points.nearest_others import MOST_OTHERS

AROUND, SIDE = 2, 5  # cells to each side in which rays are counted and ground is looked for, and across
BESIDE = 1  # cells to each side whose ground a return may belong to
CELLS, NONE = SIDE * SIDE, np.inf


@kernel
def ground_and_rays(
    points: Strided2D[np.float64],
    west: float,
    south: float,
    cell: float,
    pool: Array5D[np.float32],
    directory: Directory,
) -> Array2D[np.float64]:
    """Return (n, 2) height over the nearest ground and rays per m² that reached ground.

    They are those of the 5 x 5 cells around each point, of both epochs. The nearest ground is the one nearest
    in height, of the 3 x 3 cells if any of them holds ground. The height is NaN without ground.

    Parameters
    ----------
    points
        (n, 3), in the heights of the evidence.
    pool, directory
        Evidence, see `slz.terrain.tiles.Tiles`.
    """
    out, away = np.empty((len(points), 2)), np.empty(CELLS)
    now, mean, before, mean_before = np.zeros((4, CELLS), np.float32)
    for i in range(len(points)):
        c0 = int(np.floor((points[i, 0] - west) / cell)) - AROUND
        r0 = int(np.floor((points[i, 1] - south) / cell)) - AROUND
        k, count = 0, 0.0
        for r in range(r0, r0 + SIDE):
            slot = slot_at(directory, r, c0)
            for c in range(c0, c0 + SIDE):
                if c & (TILE - 1) == 0:
                    slot = slot_at(directory, r, c)
                now[k] = 0
                if slot >= 0:
                    held = pool[slot, r & (TILE - 1), c & (TILE - 1)]
                    now[k], mean[k] = held[0, COUNT], held[0, MEAN]
                    before[k], mean_before[k] = held[1, COUNT], held[1, MEAN]
                k += 1
        for k in range(CELLS):  # as `mean_height`; without a branch the compiler vectorises it
            height = (now[k] * mean[k] + before[k] * mean_before[k]) / (now[k] + before[k])
            away[k] = points[i, 2] - np.float32(height) if now[k] != 0 else NONE
        for k in range(CELLS):
            count += float(now[k] + before[k]) if now[k] != 0 else 0.0
        over = NONE
        for r in range(AROUND - BESIDE, AROUND + BESIDE + 1):
            for c in range(AROUND - BESIDE, AROUND + BESIDE + 1):
                over = away[SIDE * r + c] if abs(away[SIDE * r + c]) < abs(over) else over
        if over == NONE:
            for k in range(CELLS):
                over = away[k] if abs(away[k]) < abs(over) else over
        out[i, 0] = np.nan if over == NONE else over
        out[i, 1] = count / (SIDE * cell) ** 2
    return out


@kernel_part
def by_chance(others: int, expected: float) -> float:
    """Return the probability that a Poisson variable of this mean is at least `others`."""
    term = total = math.exp(-expected)
    for j in range(1, others):
        term *= expected / j
        total += term
    return max(0.0, 1.0 - total)


@kernel_part
def is_unlikely(
    records: Array2D[np.float64],
    i: int,
    first: int,
    rays_m2: float,
    share: float,
    least: float,
    false_alarm: float,
) -> bool:
    """Return whether clutter alone puts some number of others so near with less than a probability.

    Parameters
    ----------
    records, i, first
        (n, ISOLATED_FIELDS), the return, and the first field of the distances of its others.
    rays_m2, share
        Rays per m2 that passed at the height of the return, and the share of them that clutter returns.
    least
        Share of the rays through a circle that its returns must be, for it to count.
    """
    for k in range(1, MOST_OTHERS + 1):
        rays = rays_m2 * math.pi * records[i, first + k - 1] ** 2
        if not rays < np.inf:
            return False
        if k + 1 >= least * rays and by_chance(k, rays * share) < false_alarm:
            return True
    return False


@kernel
def put_onto(
    points: Strided2D[np.float64], west: float, south: float, cell: float, cells: Array3D[np.float32]
) -> None:
    """Extend top and bottom of the cells of a box to the points in them; a cell without returns gets theirs.

    Parameters
    ----------
    cells
        (6, rows, cols) of `slz.kernels.cells.cell_statistics.summarise`, from (west, south) on.
    """
    rows, cols = cells.shape[1:]
    for i in range(len(points)):
        c = int(np.floor((points[i, 0] - west) / cell))
        r = int(np.floor((points[i, 1] - south) / cell))
        if r < 0 or c < 0 or r >= rows or c >= cols:
            continue
        z = np.float32(points[i, 2])
        if cells[WEIGHT, r, c] == 0:
            cells[WEIGHT, r, c] = 1
            cells[HEIGHT, r, c] = cells[TOP, r, c] = cells[BOTTOM, r, c] = z
            cells[EXCESS, r, c] = cells[SPREAD, r, c] = 0
        else:
            cells[TOP, r, c] = max(cells[TOP, r, c], z)
            cells[BOTTOM, r, c] = min(cells[BOTTOM, r, c], z)
