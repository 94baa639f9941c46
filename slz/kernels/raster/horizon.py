"""Horizon of a point: greatest elevation angle by bearing."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array4D, Float32, Strided1D, Strided2D
from slz.kernels.cells.cell_record import IS_SAFE, TILE
from slz.kernels.cells.tile_directory import Directory, slot_at
from slz.kernels.footprint.classify import A_HEIGHT, A_TOP
from slz.kernels.jit import kernel, kernel_part

AHEAD = 0.75  # cosine between a direction and the way to a cell, below which that is left out
WEDGE = 0.55  # its square, rounded down


@kernel_part
def _see(
    east: float,
    north: float,
    rise: float,
    cell_m: float,
    near_m: float,
    far_m: float,
    lowest: float,
    ahead: float,
    to_east: float,
    to_north: float,
    out: Array1D[np.float64],
) -> None:
    """Raise the tangents of the sectors that a top spans, `rise` above the point, if it counts."""
    sectors = len(out)
    width = 2 * np.pi / sectors
    distance = np.sqrt(east * east + north * north)
    tangent = rise / distance
    if np.isnan(tangent) or distance < near_m or distance > far_m or tangent <= lowest:
        return
    if distance > 2 * cell_m and east * to_east + north * to_north < ahead * distance:
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
    to_east: float,
    to_north: float,
) -> Strided1D[np.float64]:
    """Return by sector the greatest elevation angle (rad) of a top seen from a point; NaN where unknown.

    Sectors are bearings, clockwise from north, the first centred on north. Only cells between `near_m` and
    `far_m` from the point count, each in all the sectors that it spans. With a unit direction, only the
    sectors within 20 degrees of it are computed; with 0, 0 all.
    """
    out = np.full(sectors, np.nan)  # tangents of the angles
    # A cell spans at most 15 degrees to either side; a sector ends 5 degrees beyond its middle.
    ahead = AHEAD if to_east != 0 or to_north != 0 else -2.0
    middle, lowest = min(max(np.int64(row), 0), top.shape[0] - 1), -np.inf
    for i in range(2 * top.shape[0]):  # outwards, because near tops hide most of the far ones
        r = middle + (i + 1) // 2 if i % 2 else middle - i // 2
        if r < 0 or r >= top.shape[0]:
            continue
        for c in range(top.shape[1]):
            place = (c - col) * cell_m, (r - row) * cell_m, top[r, c] - base_m
            _see(*place, cell_m, near_m, far_m, lowest, ahead, to_east, to_north, out)
        least = out.min()
        lowest = -np.inf if np.isnan(least) else least
    return np.asarray(np.arctan(out))


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
) -> Strided1D[np.float64]:
    """Return `horizon` in a direction from the tiles of a map: the sector there and the two beside it count.

    Mean heights are looked at on safe ground, tops elsewhere.

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
    ahead, lowest = int(np.round(np.arctan2(to_east, to_north) / (2 * np.pi / sectors))), -np.inf
    rows = row1 - row0
    middle = min(max(int(row), 0), rows - 1)
    for n in range(2 * rows):  # outwards, because near tops hide most of the far ones
        r = middle + (n + 1) // 2 if n % 2 else middle - n // 2
        if r < 0 or r >= rows:
            continue
        north = (r - row) * cell_m
        for c in range(col1 - col0):
            east = (c - col) * cell_m
            along = east * to_east + north * to_north
            aside = along < 0.0 or along * along < WEDGE * (east * east + north * north)
            if aside and max(abs(east), abs(north)) > 3 * cell_m:
                continue
            slot = slot_at(directory, row0 + r, col0 + c)
            if slot < 0:
                continue
            i, j = (row0 + r) & (TILE - 1), (col0 + c) & (TILE - 1)
            z, top = layers[slot, A_HEIGHT, i, j], layers[slot, A_TOP, i, j]
            if states[slot, 0, i, j] != IS_SAFE and top == top:
                z = top
            rise = np.float64(np.float32(z + np.float32(datum_m))) - base_m
            _see(east, north, rise, cell_m, near_m, far_m, lowest, AHEAD, to_east, to_north, out)
        a, b, d = out[(ahead - 1) % sectors], out[ahead % sectors], out[(ahead + 1) % sectors]
        lowest = -np.inf if np.isnan(a + b + d) else min(a, b, d)
    return np.asarray(np.arctan(out))
