"""Horizon of a point: greatest elevation angle by bearing."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array4D, Float32, Strided1D, Strided2D
from slz.kernels.cells.cell_record import IS_SAFE, TILE
from slz.kernels.cells.tile_directory import Directory, slot_at
from slz.kernels.footprint.classify import A_HEIGHT, A_TOP
from slz.kernels.jit import kernel, kernel_part

WEDGE = 0.55  # square of the cosine between a direction and the way to a cell, below which that is left out
ROUNDING = 0.01  # m, more than the rounding of a height in single precision


@kernel_part
def _see(
    east: float,
    north: float,
    rise: float,
    cell_m: float,
    near_m: float,
    far_m: float,
    lowest: float,
    out: Array1D[np.float64],
) -> None:
    """Raise the tangents of the sectors that a top spans, `rise` above the point, if it counts."""
    sectors = len(out)
    width = 2 * np.pi / sectors
    distance = np.sqrt(east * east + north * north)
    tangent = rise / distance
    if np.isnan(tangent) or distance < near_m or distance > far_m or tangent <= lowest:
        return
    bearing = np.arctan2(east, north)
    half = np.arcsin(min(1.0, 0.5 * cell_m / max(distance, 1e-9)))
    first = int(np.floor((bearing - half) / width + 0.5))
    last = int(np.floor((bearing + half) / width + 0.5))
    for s in range(first, last + 1):
        k = s % sectors
        if np.isnan(out[k]) or tangent > out[k]:
            out[k] = tangent


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
) -> Strided1D[np.float64]:
    """Return by sector the greatest elevation angle (rad) of a top seen from a point; NaN where unknown.

    Sectors are bearings, clockwise from north, the first centred on north. Only cells between `near_m` and
    `far_m` from the point count, each in all the sectors that it spans.
    """
    out = np.full(sectors, np.nan)  # tangents of the angles
    middle, lowest = min(max(np.int64(row), 0), top.shape[0] - 1), -np.inf
    for i in range(2 * top.shape[0]):  # outwards, because near tops hide most of the far ones
        r = middle + (i + 1) // 2 if i % 2 else middle - i // 2
        if r < 0 or r >= top.shape[0]:
            continue
        for c in range(top.shape[1]):
            place = (c - col) * cell_m, (r - row) * cell_m, top[r, c] - base_m
            _see(*place, cell_m, near_m, far_m, lowest, out)
        least = out.min()
        lowest = -np.inf if np.isnan(least) else least
    return np.asarray(np.arctan(out))


@kernel
def box_ahead(row: int, col: int, reach: int, east: float, north: float) -> tuple[int, int, int, int]:
    """Return the box that holds the cells within a reach of a cell and 45 degrees of a unit direction."""
    bearing, low, high, left, right = math.atan2(east, north), 0.0, 0.0, 0.0, 0.0
    for k in range(-4, 7):  # the axes, and the edges
        angle = k * math.pi / 2 if k < 5 else bearing + (2 * k - 11) * math.pi / 4
        if bearing - math.pi / 4 <= angle <= bearing + math.pi / 4:
            up, aside = reach * math.cos(angle), reach * math.sin(angle)
            low, high, left, right = min(low, up), max(high, up), min(left, aside), max(right, aside)
    return (
        row + max(-reach, math.floor(low) - 1), row + 1 + min(reach, math.ceil(high) + 1),
        col + max(-reach, math.floor(left) - 1), col + 1 + min(reach, math.ceil(right) + 1),
    )  # fmt: skip


@kernel
def horizon_of_tiles(
    layers: Array4D[np.float32],
    states: Array4D[np.uint8],
    directory: Directory,
    datum_m: Float32,
    box: tuple[int, int, int, int],
    row: float,
    col: float,
    base_m: float,
    cell_m: float,
    near_m: float,
    far_m: float,
    sectors: int,
    to_east: float,
    to_north: float,
) -> float:
    """Return the greatest angle of `horizon` of the tiles of a map, in the sector ahead and those beside it.

    Mean heights are looked at on safe ground, tops elsewhere. NaN where nothing was seen.

    Parameters
    ----------
    layers, states, directory
        Maps and states of the tiles, and their slots; heights are over `datum_m`.
    box
        row0, row1, col0, col1 (half open) of the tiles' cells looked at.
    row, col
        Of the point, from the corner of the box.
    """
    out, (row0, row1, col0, col1) = np.full(sectors, np.nan), box
    ahead, highest = int(np.round(np.arctan2(to_east, to_north) / (2 * np.pi / sectors))), -np.inf
    rows, flat, flat_states = row1 - row0, layers.ravel(), states.ravel()
    middle = min(max(int(row), 0), rows - 1)
    for step in range(2 * rows):  # outwards, because near tops hide most of the far ones
        r = middle + (step + 1) // 2 if step % 2 else middle - step // 2
        if r < 0 or r >= rows:
            continue
        north, i, first = (r - row) * cell_m, (row0 + r) & (TILE - 1), 0
        while first < col1 - col0:
            j = (col0 + first) & (TILE - 1)
            start, stop = first, min(first + TILE - j, col1 - col0)
            first, slot = stop, slot_at(directory, row0 + r, col0 + start)
            if slot < 0:
                continue
            line, state = np.uint64(i * TILE + j), np.uint64((slot * TILE + i) * TILE + j)
            height = np.uint64((slot * layers.shape[1] + A_HEIGHT) * TILE * TILE) + line
            top = np.uint64((slot * layers.shape[1] + A_TOP) * TILE * TILE) + line
            nearest = max(0.0, start - col, col - (stop - 1)) * cell_m
            bound = np.float32(-np.inf)
            if highest >= 0.0:
                hidden = base_m - datum_m + highest * np.sqrt(north * north + nearest * nearest)
                bound = np.float32(hidden - ROUNDING - 1e-5 * abs(base_m))
            higher = False
            for n in range(np.uint64(stop - start)):
                higher |= (flat[height + n] > bound) | (flat[top + n] > bound)
            if not higher:
                continue
            for c in range(start, stop):
                k = np.uint64(c - start)
                z = flat[height + k]
                if flat_states[state + k] != IS_SAFE and not np.isnan(flat[top + k]):
                    z = flat[top + k]
                if not z > bound:
                    continue
                rise = np.float64(np.float32(z + np.float32(datum_m))) - base_m
                east = (c - col) * cell_m
                along, way2 = east * to_east + north * to_north, east * east + north * north
                if highest >= 0.0 and (rise <= 0.0 or rise * rise < (1 - 1e-9) * highest * highest * way2):
                    continue
                # A cell spans at most 15 degrees to either side; a sector ends 5 degrees beyond its middle.
                if (along < 0.0 or along * along < WEDGE * way2) and max(abs(east), abs(north)) > 3 * cell_m:
                    continue
                _see(east, north, rise, cell_m, near_m, far_m, highest, out)
            for sector in (ahead - 1, ahead, ahead + 1):
                tangent = out[sector % sectors]
                highest = highest if np.isnan(tangent) else max(highest, tangent)
    return math.atan(highest) if highest > -np.inf else np.nan
