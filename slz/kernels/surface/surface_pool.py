"""Tiles of surface cells in slots of a pool: who holds one, reading and writing of boxes, refused cells."""

from __future__ import annotations

import math

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D, Array4D, Float32
from slz.kernels.cells.cell_record import TILE, TILE_BITS
from slz.kernels.elementary_functions import median
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.surface.surface_record import (
    COUNT,
    KIND,
    LAYERS,
    N_LAYERS,
    OBLIQUE,
    SHAPE,
    SHAPE_S,
    SURFACE_FIELDS,
    TIME,
    WATER,
)

ROW, COL, USED_S, N_REFUSED = range(4)  # of a slot's tile, and its refused cells; free ones were used at -inf
OBLIQUE_SHARE = np.float32(0.2)  # of the returns of a box, above which a sensor sees obliquely


@kernel_part
def _slots_of(tiles: Array2D[np.float64], row: int, col: int, rows: int, cols: int) -> Array2D[np.int32]:
    """Return the slots of a rectangle of tiles, -1 for none."""
    out = np.full((rows, cols), -1, np.int32)
    for slot in range(len(tiles)):
        r, c = int(tiles[slot, ROW]) - row, int(tiles[slot, COL]) - col
        if 0 <= r < rows and 0 <= c < cols and tiles[slot, USED_S] > -np.inf:
            out[r, c] = slot
    return out


@kernel_part
def _slots_under(tiles: Array2D[np.float64], row: int, col: int, rows: int, cols: int) -> Array2D[np.int32]:
    """Return the slots of the tiles under a box of cells, -1 for none."""
    row0, col0 = row >> TILE_BITS, col >> TILE_BITS
    last_row, last_col = (row + rows - 1) >> TILE_BITS, (col + cols - 1) >> TILE_BITS
    return _slots_of(tiles, row0, col0, last_row - row0 + 1, last_col - col0 + 1)


@kernel_part
def _oldest(tiles: Array2D[np.float64], row: int, col: int, hit: Array2D[np.bool_]) -> int:
    """Return the slot least recently used, of equal ones the first in rows, but of no tile that is hit."""
    oldest = -1
    for slot in range(len(tiles)):
        r, c = int(tiles[slot, ROW]) - row, int(tiles[slot, COL]) - col
        if 0 <= r < hit.shape[0] and 0 <= c < hit.shape[1] and hit[r, c] and tiles[slot, USED_S] > -np.inf:
            continue
        for field in (USED_S, ROW, COL):
            if oldest < 0 or tiles[slot, field] < tiles[oldest, field]:
                oldest = slot
            if tiles[slot, field] != tiles[oldest, field]:
                break
    return oldest


@kernel
def claim(
    points: Array2D[np.float64],
    is_near: Array1D[np.bool_],
    edges: tuple[float, float, float, float],
    place: tuple[float, float, float],
    now_s: float,
    tiles: Array2D[np.float64],
    pool: Array4D[np.float32],
) -> tuple[Array1D[np.float64], Array2D[np.int32], int, int, Array2D[np.float64]]:
    """Give a slot to each tile that near points hit, in order; the tiles least recently hit give theirs up.

    Return west, south, east and north of the near points within the edges; the slots of the tiles from the
    south-western one of them on, -1 for none; its row and column; and the edges of the tiles given up in
    which cells were refused, (n, 4).

    Parameters
    ----------
    place
        West and south edge of the first cell, and side of a cell.
    tiles, pool
        (slots, 4) of ROW, COL, USED_S, N_REFUSED, and (slots, TILE, TILE, RECORD).
    """
    hull, (west, south, cell) = np.array((np.inf, np.inf, -np.inf, -np.inf)), place
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        if is_near[i] and edges[0] <= x < edges[2] and edges[1] <= y < edges[3]:
            hull[0], hull[1] = min(hull[0], x), min(hull[1], y)
            hull[2], hull[3] = max(hull[2], x), max(hull[3], y)
    side, n_given, given_up = cell * TILE, 0, np.empty((len(tiles), 4))
    if hull[0] > hull[2]:
        return hull, np.empty((0, 0), np.int32), 0, 0, given_up[:0]
    row, col = math.floor((hull[1] - south) / side), math.floor((hull[0] - west) / side)
    rows = math.floor((hull[3] - south) / side) - row + 1
    cols = math.floor((hull[2] - west) / side) - col + 1
    hit, table = np.zeros((rows, cols), np.bool_), _slots_of(tiles, row, col, rows, cols)
    corner_x, corner_y = west + col * side, south + row * side
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        if is_near[i] and edges[0] <= x < edges[2] and edges[1] <= y < edges[3]:
            r, c = math.floor((y - corner_y) / side), math.floor((x - corner_x) / side)
            if 0 <= r < rows and 0 <= c < cols:
                hit[r, c] = True
    for r, c in np.ndindex(rows, cols):
        slot = table[r, c]
        if hit[r, c] and slot < 0:
            slot = _oldest(tiles, row, col, hit)
            if slot >= 0:
                if tiles[slot, N_REFUSED] > 0:
                    x, y = west + tiles[slot, COL] * side, south + tiles[slot, ROW] * side
                    given_up[n_given, 0], given_up[n_given, 1] = x, y
                    given_up[n_given, 2], given_up[n_given, 3] = x + side, y + side
                    n_given += 1
                pool[slot], tiles[slot, N_REFUSED] = 0, 0
                tiles[slot, ROW], tiles[slot, COL] = row + r, col + c
        if hit[r, c] and slot >= 0:
            tiles[slot, USED_S] = now_s
    return hull, _slots_of(tiles, row, col, rows, cols), row, col, given_up[:n_given]


@kernel
def read(
    tiles: Array2D[np.float64],
    pool: Array4D[np.float32],
    row: int,
    col: int,
    first: int,
    out: Array3D[np.float32],
) -> None:
    """Read fields from a first one on of a box of cells from a row and column on, 0 where no tile is."""
    n_fields, rows, cols = out.shape
    table = _slots_under(tiles, row, col, rows, cols)
    for r in range(rows):
        i, tile_row = (row + r) & (TILE - 1), ((row + r) >> TILE_BITS) - (row >> TILE_BITS)
        for tile_col in range(table.shape[1]):
            slot, col0 = table[tile_row, tile_col], ((col >> TILE_BITS) + tile_col) * TILE - col
            for k in range(n_fields):
                for c in range(max(0, col0), min(cols, col0 + TILE)):
                    out[k, r, c] = pool[slot, i, c - col0, first + k] if slot >= 0 else 0


@kernel
def gather(
    tiles: Array2D[np.float64],
    pool: Array4D[np.float32],
    row: int,
    col: int,
    now_s: Float32,
    max_age_s: Float32,
    hold_s: Float32,
    out: Array3D[np.float32],
) -> tuple[bool, bool, bool]:
    """Read the evidence not older than `max_age_s`, and the SHAPE not older than `hold_s`, of a box of cells.

    Return whether a return was seen in it, whether the sensor saw obliquely, and whether some SHAPE is older.

    Parameters
    ----------
    out
        (SURFACE_FIELDS + 2, rows, cols) from a row and column on, written: evidence, SHAPE and SHAPE_S.
    """
    read(tiles, pool, row, col, 0, out[:SURFACE_FIELDS])
    read(tiles, pool, row, col, LAYERS + SHAPE, out[SURFACE_FIELDS:])
    n, n_oblique, is_outdated, f = 0.0, 0.0, False, out.reshape(len(out), -1)
    for k in range(f.shape[1]):
        if now_s - f[TIME, k] > max_age_s:
            f[:SURFACE_FIELDS, k] = 0
        n, n_oblique = n + f[COUNT, k], n_oblique + f[OBLIQUE, k]
        if f[SURFACE_FIELDS, k] != 0 and now_s - f[SURFACE_FIELDS + 1, k] > hold_s:
            f[SURFACE_FIELDS, k], is_outdated = 0, True
    return n > 0, bool(np.float32(n_oblique) > OBLIQUE_SHARE * np.float32(n)), is_outdated


@kernel_part
def _refuses(water: np.float32, kind: np.float32, suspicion: Float32, kinds: Array1D[np.bool_]) -> bool:
    return bool(water > suspicion or kinds[int(kind)])


@kernel
def store(
    tiles: Array2D[np.float64],
    pool: Array4D[np.float32],
    row: int,
    col: int,
    place: tuple[float, float, float],
    suspicion: Float32,
    kinds: Array1D[np.bool_],
    now_s: Float32,
    is_far: bool,
    found: Array3D[np.float32],
) -> Array2D[np.float64]:
    """Write the layers of a box of cells; return by tile the edges of what is refused otherwise than before.

    Parameters
    ----------
    suspicion, kinds
        Probability of water above which a cell is refused, and whether one of each kind is.
    is_far
        Whether SHAPE was found with all its surroundings, and counts as that of now.
    found
        (N_LAYERS, rows, cols) from a row and column on.
    """
    _, rows, cols = found.shape
    west, south, cell = place
    edges, n = np.empty((len(tiles), 4)), 0
    for slot in _slots_under(tiles, row, col, rows, cols).ravel():
        if slot < 0:
            continue
        row0, col0 = int(tiles[slot, ROW]) * TILE, int(tiles[slot, COL]) * TILE
        first_row, last_row, first_col, last_col = TILE, -1, TILE, -1
        for i in range(max(0, row - row0), min(TILE, row + rows - row0)):
            for j in range(max(0, col - col0), min(TILE, col + cols - col0)):
                r, c = row0 + i - row, col0 + j - col
                water, kind = pool[slot, i, j, LAYERS + WATER], pool[slot, i, j, LAYERS + KIND]
                before = _refuses(water, kind, suspicion, kinds)
                after = _refuses(found[WATER, r, c], found[KIND, r, c], suspicion, kinds)
                for k in range(N_LAYERS):
                    pool[slot, i, j, LAYERS + k] = found[k, r, c]
                if is_far:
                    pool[slot, i, j, SHAPE_S] = now_s
                if before != after:
                    tiles[slot, N_REFUSED] += 1 if after else -1
                    first_row, last_row = min(first_row, i), max(last_row, i)
                    first_col, last_col = min(first_col, j), max(last_col, j)
        if last_row >= 0:
            x, y = west + tiles[slot, COL] * (cell * TILE), south + tiles[slot, ROW] * (cell * TILE)
            edges[n, 0], edges[n, 1] = x + first_col * cell, y + first_row * cell
            edges[n, 2], edges[n, 3] = x + (last_col + 1) * cell, y + (last_row + 1) * cell
            n += 1
    return edges[:n]


@kernel
def read_refused(
    tiles: Array2D[np.float64],
    pool: Array4D[np.float32],
    place: tuple[float, float, float],
    suspicion: Float32,
    kinds: Array1D[np.bool_],
    corner: tuple[float, float],
    side: float,
    out: Array2D[np.bool_],
) -> bool:
    """Write whether the surface is refused at the centre of each cell of a raster.

    Return False, with nothing written, where no tile under the raster has such a cell.

    Parameters
    ----------
    corner, side
        West and south edge of the raster, and side of its cells.
    """
    (rows, cols), (west, south, cell) = out.shape, place
    at_row, at_col = np.empty(rows, np.int64), np.empty(cols, np.int64)
    for r in range(rows):
        at_row[r] = math.floor((corner[1] + (r + 0.5) * side - south) / cell)
    for c in range(cols):
        at_col[c] = math.floor((corner[0] + (c + 0.5) * side - west) / cell)
    row, col = at_row[0], at_col[0]
    table, any_refused = _slots_under(tiles, row, col, at_row[-1] - row + 1, at_col[-1] - col + 1), False
    for slot in table.ravel():
        any_refused |= bool(slot >= 0 and tiles[slot, N_REFUSED] > 0)
    for r in range(rows if any_refused else 0):
        if r > 0 and at_row[r] == at_row[r - 1]:
            for c in range(cols):
                out[r, c] = out[r - 1, c]
            continue
        i, tile_row = at_row[r] & (TILE - 1), (at_row[r] >> TILE_BITS) - (row >> TILE_BITS)
        for c in range(cols):
            if c > 0 and at_col[c] == at_col[c - 1]:
                out[r, c] = out[r, c - 1]
                continue
            j, slot = at_col[c] & (TILE - 1), table[tile_row, (at_col[c] >> TILE_BITS) - (col >> TILE_BITS)]
            water, kind = pool[slot, i, j, LAYERS + WATER], pool[slot, i, j, LAYERS + KIND]
            out[r, c] = slot >= 0 and _refuses(water, kind, suspicion, kinds)
    return any_refused


@kernel
def median_height(
    points: Array2D[np.float64],
    is_near: Array1D[np.bool_],
    edges: tuple[float, float, float, float],
    x: float,
    y: float,
    within: float,
) -> float:
    """Return the median height of the near points within the edges and a distance of a place, or of all."""
    heights, n = np.empty(len(points)), 0
    for farthest in (within, np.inf):
        for i in range(len(points)):
            dx, dy = points[i, 0] - x, points[i, 1] - y
            if not is_near[i] or dx * dx + dy * dy >= farthest * farthest:
                continue
            if edges[0] <= points[i, 0] < edges[2] and edges[1] <= points[i, 1] < edges[3]:
                heights[n] = points[i, 2]
                n += 1
        if n > 0:
            break
    return float(median(heights[:n]))
