"""Accumulation of returns and of lost rays in surface cells."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array4D, Float32, ReadOnly1D
from slz.kernels.cells.cell_record import TILE, TILE_BITS
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.surface.surface_record import (
    ANSWER_M,
    APART_M,
    ASIDE,
    ASIDE_DEG,
    ASIDE_LIGHT,
    ASIDE_M,
    COUNT,
    DARK,
    DARKEST,
    DEEP,
    DIFFUSE_DEG,
    FARTHEST_M,
    FLATTEST_DEG,
    HIGH,
    LOST_NEAR,
    LOST_OBLIQUE,
    LOST_SLANTED,
    LOW,
    MEAN,
    NADIR,
    NADIR_DEG,
    NADIR_LIGHT,
    NADIR_M,
    NO_MIRROR_DEG,
    NUMBERED,
    OBLIQUE,
    OBLIQUE_DEG,
    RECORD,
    REPORTED,
    SEVERAL,
    SLANTED,
    SLANTED_DEG,
    SQUARES,
    SUMS,
    SURE_M,
    SURFACE_FIELDS,
    TALL,
    TIME,
)

MOST_COUNT = np.float32(50_000)  # returns of a cell, above which all its sums are halved
SLANTED_TAN2 = math.tan(math.radians(SLANTED_DEG)) ** 2
OBLIQUE_TAN2 = math.tan(math.radians(OBLIQUE_DEG)) ** 2
FLATTEST_TAN2 = math.tan(math.radians(FLATTEST_DEG)) ** 2
NADIR_TAN2 = math.tan(math.radians(NADIR_DEG)) ** 2
ASIDE_TAN2 = math.tan(math.radians(ASIDE_DEG)) ** 2
NO_MIRROR_TAN2 = math.tan(math.radians(NO_MIRROR_DEG)) ** 2
DIFFUSE_TAN2 = math.tan(math.radians(DIFFUSE_DEG)) ** 2
MOST_WEIGHT = np.float32(100)  # rays that a driver's report stands for
MOST_DARK = np.float32(100)  # so that a change of the ground is seen
F1, APART = np.float32(1), np.float32(APART_M)


@kernel_part
def _number_of(table: Array2D[np.int32], row: int, col: int) -> int:
    """Return the number of a cell in the pool, negative for none."""
    slot = int(table[row >> TILE_BITS, col >> TILE_BITS])
    return (slot << 2 * TILE_BITS) + ((row & (TILE - 1)) << TILE_BITS) + (col & (TILE - 1))


@kernel
def add_returns(
    points: Array2D[np.float64],
    origin: ReadOnly1D[np.uint16],
    origins: Array2D[np.float64],
    is_near: Array1D[np.bool_],
    intensity: Array1D[np.float32],
    echoes: Array1D[np.uint8],
    now_s: Float32,
    max_age_s: Float32,
    west: float,
    south: float,
    cell: float,
    table: Array2D[np.int32],
    pool: Array4D[np.float32],
) -> None:
    """Add returns to their cells; cells not hit for `max_age_s` are cleared first.

    Parameters
    ----------
    points
        (n, 3).
    origin, origins
        (n,) row of each return's sensor position in (k, 3); empty, or NaN, where the incidence is unknown.
    is_near
        (n,), whether the height counts; of the others only incidence and echoes do.
    intensity
        (n,) share of the light of a white target, NaN where unknown; or empty.
    echoes
        (n,) number of returns of the ray, 0 where unknown; or empty.
    table, pool
        Slot of each tile, -1 for none, from (west, south) on, and (slots, TILE, TILE, RECORD).
    """
    rows, cols, known = table.shape[0] * TILE, table.shape[1] * TILE, len(origin) > 0
    cells = pool.reshape(-1, RECORD)  # a view of a cell would cost as much as its sums
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        row, col = np.floor((y - south) / cell), np.floor((x - west) / cell)
        if not (row >= 0.0 and col >= 0.0 and row < rows and col < cols):
            continue
        k = _number_of(table, int(row), int(col))
        if k < 0:
            continue
        if now_s - cells[k, TIME] > max_age_s:
            for f in range(SURFACE_FIELDS):
                cells[k, f] = 0
        cells[k, TIME] = now_s
        if is_near[i]:
            h = np.float32(z)
            if cells[k, COUNT] > 0:
                cells[k, DEEP] += h < cells[k, MEAN] - APART
                cells[k, TALL] += h > cells[k, MEAN] + APART
                cells[k, LOW], cells[k, HIGH] = min(cells[k, LOW], h), max(cells[k, HIGH], h)
            else:
                cells[k, LOW] = cells[k, HIGH] = h
            cells[k, COUNT] += F1
            off = h - cells[k, MEAN]
            cells[k, MEAN] += off / cells[k, COUNT]
            cells[k, SQUARES] += off * (h - cells[k, MEAN])
        if len(echoes) > 0 and echoes[i] > 0:
            cells[k, NUMBERED] += F1
            cells[k, SEVERAL] += echoes[i] > 1
        if known:
            at = np.int64(origin[i])
            dx, dy, dz = x - origins[at, 0], y - origins[at, 1], origins[at, 2] - z
            tan2 = (dx * dx + dy * dy) / (dz * dz) if dz > 0.0 else np.inf
            cells[k, OBLIQUE] += tan2 >= OBLIQUE_TAN2
            cells[k, SLANTED] += SLANTED_TAN2 <= tan2 < OBLIQUE_TAN2
            if len(intensity) > 0 and intensity[i] == intensity[i]:
                if DIFFUSE_TAN2 <= tan2 < FLATTEST_TAN2:
                    # A diffuse target is dimmer by the cosine.
                    dark = intensity[i] * np.sqrt(1 + tan2) < DARKEST
                    if dark:
                        cells[k, DARK] = min(MOST_DARK, cells[k, DARK] + F1)
                    elif tan2 >= NO_MIRROR_TAN2:
                        cells[k, DARK] = max(-MOST_DARK, cells[k, DARK] - F1)
                if is_near[i]:
                    if tan2 < NADIR_TAN2:
                        cells[k, NADIR] += F1
                        cells[k, NADIR_M] += (np.float32(z) - cells[k, NADIR_M]) / cells[k, NADIR]
                        cells[k, NADIR_LIGHT] += (intensity[i] - cells[k, NADIR_LIGHT]) / cells[k, NADIR]
                    elif ASIDE_TAN2 <= tan2 < OBLIQUE_TAN2:
                        cells[k, ASIDE] += F1
                        cells[k, ASIDE_M] += (np.float32(z) - cells[k, ASIDE_M]) / cells[k, ASIDE]
                        cells[k, ASIDE_LIGHT] += (intensity[i] - cells[k, ASIDE_LIGHT]) / cells[k, ASIDE]
        if cells[k, COUNT] > MOST_COUNT:
            for f in range(SUMS):
                cells[k, f] *= np.float32(0.5)


@kernel
def add_lost(
    rays: Array2D[np.float64],
    origins: Array2D[np.float64],
    weights: ReadOnly1D[np.float32],
    ground_m: float,
    now_s: Float32,
    max_age_s: Float32,
    west: float,
    south: float,
    cell: float,
    table: Array2D[np.int32],
    pool: Array4D[np.float32],
) -> int:
    """Add rays without a return to the cells where they met the ground; return how many counted.

    The ground is at `ground_m`, or at the mean of the cell's returns if it has any. Rays that met it beyond
    `FARTHEST_M`, too steeply or too flatly, or where no tile is, do not count; beyond `ANSWER_M` they count
    less, with the square of the range, because dark ground may not have answered either.

    Parameters
    ----------
    rays, origins
        (n, 3), a point on each ray and the sensor's position when it was fired, in the heights of the cells.
    weights
        (n,), number of rays that each stands for.
    """
    rows, cols, n = table.shape[0] * TILE, table.shape[1] * TILE, 0
    cells = pool.reshape(-1, RECORD)
    for i in range(len(rays)):
        east, north, up = origins[i, 0], origins[i, 1], origins[i, 2]
        dx, dy, dz = rays[i, 0] - east, rays[i, 1] - north, up - rays[i, 2]
        if not dz > 0.0 or not 0.0 < weights[i] <= MOST_WEIGHT:
            continue
        tan2 = (dx * dx + dy * dy) / (dz * dz)
        if not (SLANTED_TAN2 <= tan2 <= FLATTEST_TAN2):
            continue
        height, k = ground_m, -1
        for _ in range(2):
            t = (up - height) / dz
            row = np.floor((north + t * dy - south) / cell)
            col = np.floor((east + t * dx - west) / cell)
            k = -1
            if not (t > 0.0 and row >= 0.0 and col >= 0.0 and row < rows and col < cols):
                break
            k = _number_of(table, int(row), int(col))
            if k < 0 or cells[k, COUNT] == 0:
                break
            height = float(cells[k, MEAN])
        drop = up - height
        range2 = drop * drop * (1 + tan2)
        if k >= 0 and drop > 0.0 and range2 <= FARTHEST_M * FARTHEST_M:
            share = min(1.0, ANSWER_M * ANSWER_M / range2)
            field = LOST_OBLIQUE if tan2 >= OBLIQUE_TAN2 else LOST_SLANTED
            if now_s - cells[k, TIME] > max_age_s:
                for f in range(SURFACE_FIELDS):
                    cells[k, f] = 0
            cells[k, TIME] = now_s
            cells[k, field] += np.float32(weights[i] * share)
            if range2 <= SURE_M * SURE_M:
                cells[k, LOST_NEAR] += weights[i]
            cells[k, REPORTED] += F1
            n += 1
    return n
