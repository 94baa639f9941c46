"""Views of a zone in the tiles of a map: its obstacles, its sure ground, and what is at its landing point.

A map is given by the layers of its tiles (slots, layers, TILE, TILE), the table of the slots, -1 for none,
the row and column of the grid at the table's corner, and the indices of `HEIGHT`, `TOP`, `SLOPE` and
`CERTAINTY` among the layers. A zone is given by a bitmap whose words are rows of tiles, and the row and
column of the grid of its first cell.
"""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array4D
from slz.kernels.cells.cell_record import TILE, TILE_BITS
from slz.kernels.elementary_functions import median
from slz.kernels.jit import kernel, kernel_part
from slz.kernels.raster.bitmap import NONE, ONE, Bits, bit, lowest, signed, word_mask
from slz.kernels.raster.connected_components import highest_cells, largest_groups
from slz.kernels.raster.distance_transform import distances2, greatest_clearance, largest_square
from slz.kernels.raster.morphology import erode_to_side

Layers = Array4D[np.float32]
Table = Array2D[np.int32]
Places = tuple[int, int, int, int]
Heights = Array1D[np.float32]
HEIGHT, TOP, SLOPE, CERTAINTY = range(4)


@kernel
def heights_at(
    layers: Layers, table: Table, row0: int, col0: int, at: Places, cells: Array2D[np.int32]
) -> Heights:
    """Return the mean heights at (n, 2) cells of the grid, all of which are in tiles."""
    out = np.empty(len(cells), np.float32)
    for i in range(len(cells)):
        r, c = cells[i, 0] - row0, cells[i, 1] - col0
        slot = table[r >> TILE_BITS, c >> TILE_BITS]
        out[i] = layers[slot, at[HEIGHT], r & (TILE - 1), c & (TILE - 1)]
    return out


@kernel_part
def _ground(
    layers: Layers, table: Table, height: int, down: int, right: int, own: Bits, box: Places, found: Heights
) -> tuple[float, Heights]:
    """Return the median of the known heights of a zone's cells in a box, NaN for none; and a buffer."""
    n = 0
    for r in range(box[0], box[1]):
        i, k = (r + down) >> TILE_BITS, (r + down) & (TILE - 1)
        for w in range(box[2] >> 6, ((box[3] - 1) >> 6) + 1):
            word, slot = own[r, w] & word_mask(box[2] - 64 * w, box[3] - 64 * w), table[i, (right >> 6) + w]
            if slot < 0:
                continue
            if n + 64 > len(found):
                found = np.concatenate((found, np.empty_like(found)))
            while word != NONE:
                found[n] = layers[slot, height, k, signed(lowest(word))]
                n += np.isfinite(found[n])
                word &= word - ONE
    return np.float64(np.float32(median(found[:n]))) if n else np.nan, found


@kernel_part
def _all_same(same: Array2D[np.bool_], box: Places, down: int) -> bool:
    """Return whether all tiles under a box of a zone are unchanged; `same` begins with those of the zone."""
    first = down >> TILE_BITS
    for i in range(((box[0] + down) >> TILE_BITS) - first, ((box[1] - 1 + down) >> TILE_BITS) - first + 1):
        for j in range(box[2] >> 6, ((box[3] - 1) >> 6) + 1):
            if not same[i, j]:
                return False
    return True


@kernel
def zone_obstacles(
    layers: Layers,
    table: Table,
    row0: int,
    col0: int,
    at: Places,
    row: int,
    col: int,
    own: Bits,
    holes: Bits,
    most: int,
    around: int,
    same: Array2D[np.bool_],
    old: Array2D[np.int64],
    old_grounds: Array1D[np.float64],
) -> tuple[Array2D[np.int64], Array2D[np.int32], Array1D[np.int64], Heights, Array1D[np.float64]]:
    """Return the `most` largest groups of holes of a zone, their tops, and the ground around them.

    Parameters
    ----------
    around
        Cells around a group whose own ground its height refers to.
    same
        Tiles under the zone in which neither the zone nor the map changed since the old groups.
    old, old_grounds
        Groups, and grounds of an earlier zone of the same grid, none where nothing is the same.

    Returns
    -------
    (n, 6) row0, row1, col0, col1 in the grid, start and stop in the cells; (m, 2) cells of the grid, group by
    group; (n,) index of the highest; (n,) its top, -inf where unknown; (n,) median height of the ground.
    """
    groups, cells = largest_groups(holes, most)
    down, right, tops = row - row0, col - col0, np.full(len(cells), np.float32(np.nan))
    for i in range(len(cells)):
        r, c = cells[i, 0] + down, cells[i, 1] + right
        slot, r, c = table[r >> TILE_BITS, c >> TILE_BITS], r & (TILE - 1), c & (TILE - 1)
        if slot >= 0:
            top = layers[slot, at[TOP], r, c]
            tops[i] = layers[slot, at[HEIGHT], r, c] if np.isnan(top) else top
        cells[i, 0] += row
        cells[i, 1] += col
    highest = highest_cells(tops, groups)
    summit, grounds, k = np.empty(len(groups), np.float32), np.empty(len(groups)), 0
    found = np.empty(4096, np.float32)
    for g in range(len(groups)):
        summit[g] = -np.inf if np.isnan(tops[highest[g]]) else tops[highest[g]]
        r0, r1, c0, c1 = groups[g, 0], groups[g, 1], groups[g, 2], groups[g, 3]
        box = (
            max(0, r0 - around), min(own.shape[0], r1 + around),
            max(0, c0 - around), min(64 * own.shape[1], c1 + around),
        )  # fmt: skip
        r0, r1, c0, c1 = r0 + row, r1 + row, c0 + col, c1 + col
        groups[g, 0], groups[g, 1], groups[g, 2], groups[g, 3] = r0, r1, c0, c1
        while k < len(old) and old[k, 0] < r0:  # groups are in the order of their first rows
            k += 1
        known = k
        while known < len(old) and old[known, 0] == r0 and (
            old[known, 1] != r1 or old[known, 2] != c0 or old[known, 3] != c1
        ):  # fmt: skip
            known += 1
        if known < len(old) and old[known, 0] == r0 and _all_same(same, box, down):
            grounds[g] = old_grounds[known]
        else:
            grounds[g], found = _ground(layers, table, at[HEIGHT], down, right, own, box, found)
    return groups, cells, highest, summit, grounds


@kernel_part
def _ground_at(
    layers: Layers,
    table: Table,
    row0: int,
    col0: int,
    at: Places,
    cells: Array2D[np.int64],
    grid: tuple[float, float, float],
    error_m: float,
) -> Array2D[np.float32]:
    """Return (4, n) slopes, certainties, least certainties and heights of cells, see `sure_clearance`."""
    out, (west, south, cell) = np.empty((4, len(cells)), np.float32), grid
    for k in range(len(cells)):
        north, east = south + (cells[k, 0] + 0.5) * cell, west + (cells[k, 1] + 0.5) * cell
        least = np.float32(np.inf)
        r0, c0 = np.floor((north - error_m - south) / cell), np.floor((east - error_m - west) / cell)
        r1, c1 = np.floor((north + error_m - south) / cell), np.floor((east + error_m - west) / cell)
        for r in range(int(r0) - row0, int(r1) - row0 + 1):
            for c in range(int(c0) - col0, int(c1) - col0 + 1):
                i, j, slot = r >> TILE_BITS, c >> TILE_BITS, -1
                if 0 <= i < table.shape[0] and 0 <= j < table.shape[1]:
                    slot = table[i, j]
                sure = layers[slot, at[CERTAINTY], r & (TILE - 1), c & (TILE - 1)] if slot >= 0 else 0.0
                least = min(least, np.float32(sure))
        r, c = cells[k, 0] - row0, cells[k, 1] - col0
        slot, r, c = table[r >> TILE_BITS, c >> TILE_BITS], r & (TILE - 1), c & (TILE - 1)
        slope = layers[slot, at[SLOPE], r, c]
        out[0, k], out[1, k] = 90.0 if np.isnan(slope) else slope, layers[slot, at[CERTAINTY], r, c]
        out[2, k], out[3, k] = least, layers[slot, at[HEIGHT], r, c]
    return out


@kernel
def sure_clearance(
    layers: Layers,
    table: Table,
    row0: int,
    col0: int,
    at: Places,
    row: int,
    col: int,
    own: Bits,
    farthest: Array2D[np.int64],
    square_side: int,
    side: int,
    certainties: Heights,
    grid: tuple[float, float, float],
    error_m: float,
) -> tuple[Array2D[np.int64], Array1D[np.int64], Array2D[np.float32]]:
    """Return a zone's farthest cells that are amid undoubted ground, else the farthest of the surest ground.

    Parameters
    ----------
    farthest, square_side
        `greatest_clearance` of the zone, and the side of its largest square.
    side
        Side of the square of sure ground that a cell must be amid.
    certainties
        That of undoubted ground, and of less and less sure ground, tried until there is any.
    grid, error_m
        West and south edge of the grid, its cells' size, and by how much a cell may be missed (m).

    Returns
    -------
    (n, 2) rows and columns of the grid; (n,) squared distances from the outside of the zone; (4, n) slopes,
    90 where unknown, certainties, the least certainties within the error, and mean heights.
    """
    down, right, (rows, words), n = row - row0, col - col0, own.shape, 0
    found, distance2 = farthest[:, :2].copy(), farthest[:, 2].copy()
    r0, r1, w0, w1 = rows, 0, words, 0  # of the squares around the farthest cells
    for k in range(len(farthest)):
        r, c = farthest[k, 0] - (side - 1) // 2, farthest[k, 1] - (side - 1) // 2
        r0, r1, w0, w1 = min(r0, r), max(r1, r + side), min(w0, c >> 6), max(w1, ((c + side - 1) >> 6) + 1)
    for trial in range(len(certainties) + 1):
        sure, least = np.zeros_like(own), certainties[max(0, trial - 1)]
        for r in range(max(0, r0), min(r1, rows)):
            for w in range(max(0, w0), min(w1, words)):
                slot = table[(r + down) >> TILE_BITS, (right >> 6) + w]
                if own[r, w] != NONE and slot >= 0:
                    word = NONE
                    for b in range(np.uint64(64)):
                        is_sure = layers[slot, at[CERTAINTY], (r + down) & (TILE - 1), b] >= least
                        word |= np.uint64(is_sure) << b
                    sure[r, w] = own[r, w] & word
        corners = sure.copy()
        erode_to_side(corners, 1, side)
        for k in range(len(farthest) if trial == 0 else 0):
            r, c = farthest[k, 0] - (side - 1) // 2, farthest[k, 1] - (side - 1) // 2
            if r >= 0 and c >= 0 and bit(corners, r, c) == ONE:
                found[n, 0], found[n, 1], distance2[n] = farthest[k, 0], farthest[k, 1], farthest[k, 2]
                n += 1
        r0, r1, w0, w1 = 0, rows, 0, words
        if n:
            found, distance2 = found[:n].copy(), distance2[:n].copy()
            break
        if trial and corners.any():
            found = greatest_clearance(sure, largest_square(corners, side), farthest[:0])[:, :2].copy()
            distance2 = distances2(own, found, square_side)
            break
    for k in range(len(found)):
        found[k, 0] += row
        found[k, 1] += col
    return found, distance2, _ground_at(layers, table, row0, col0, at, found, grid, error_m)
