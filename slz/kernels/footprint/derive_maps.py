"""Derived maps of a box of cells, computed patch by patch so that intermediate sums stay in the cache."""

from __future__ import annotations

import numpy as np

from slz.kernels.argument_types import Array1D, Array2D, Array3D, Array4D, Strided2D
from slz.kernels.cells.cell_record import HEIGHT, TILE, TILE_BITS, TOP
from slz.kernels.cells.tile_boxes import or_word
from slz.kernels.footprint.certainty import hazard_quarters
from slz.kernels.footprint.classify import (
    A_CERTAINTY,
    A_HEIGHT,
    A_TOP,
    certainty_of_doubtful,
    classify,
    leave_unknown,
)
from slz.kernels.footprint.moments import INVERSE, LOWER, PATCH_LAYERS, RISE, RISES, SUMS, UPPER, over_rows
from slz.kernels.footprint.patch import (
    COLS,
    MOST_SAMPLED,
    gather_cells,
    middle_height,
    rows_of_patch,
)
from slz.kernels.footprint.plane_fit import PLANE, PLANE_STATISTICS, Limits, add_inner_relief, fit_planes
from slz.kernels.footprint.rest_pose import Contacts, GearLimits, refuse_without_heading, scratch_for
from slz.kernels.jit import kernel, kernel_at_call
from slz.kernels.raster.bitmap import ALL, NONE, Bits, word_at
from slz.kernels.simd import LANES, load, store

LOW16, LOW32 = np.uint64(0xFFFF), np.uint64(0xFFFFFFFF)
Row = Array1D[np.float32]
Table = Array2D[np.int32]


@kernel_at_call
def derive_box(
    cells: Array3D[np.float32],
    covered: Bits,
    unseen: Bits,
    edge: int,
    radius: int,
    limits: Limits,
    contacts: Contacts,
    gear: GearLimits,
    box: tuple[int, int, int, int],
    maps: Row,
    to: int,
    layer: int,
    stride: int,
    states: Array1D[np.uint8],
    place: int,
    dirty: Bits,
    levels: Strided2D[np.float32],
) -> tuple[int, int]:
    """Derive the maps and states of a box of cells, see `slz.terrain.derive.derive`.

    Return how many were derived, and of how many the state changed.

    Parameters
    ----------
    cells
        (6, rows, cols) of `summarise`.
    covered, unseen
        Bitmaps of the cells: footprint wholly covered by seen cells; footprint holds unseen ground.
    edge, radius
        Margin of cells that are not derived, and radius of a footprint, at most the margin.
    contacts, gear
        Contacts of the gear by heading, none for no gear, and limits: `slz.kernels.footprint.rest_pose`.
    box
        row0, row1, col0, col1 (half open), relative to the margin; columns in whole lanes.
    maps, to, layer, stride
        Maps, index of the first cell in the first map, distance to the next map and to the next row.
    states, place
        States, and index of the first cell's state.
    dirty, levels
        Cells that may change, likewise with a margin; and of each patch of the box the height that its
        heights were relative to, which is rewritten: where it has changed, all its cells may.
    """
    row0, row1, col0, col1 = box
    cell_m, _, slope_limit, relief_limit, hazard_m = limits
    quarters = hazard_quarters(cell_m, hazard_m)
    k, high, cols, flat = radius, rows_of_patch(radius), cells.shape[2], cells.ravel()
    tall, wide, rows = high + 2 * k, -(-(COLS + 2 * k) // LANES) * LANES, cells.shape[1]
    held, sums = np.empty(PATCH_LAYERS * tall * wide, np.float32), np.empty(SUMS * high * wide, np.float32)
    rises, away = np.empty(RISES * high * wide), np.arange(-k, k + 1).astype(np.float32)
    lower, upper = held[LOWER * tall * wide : UPPER * tall * wide], held[UPPER * tall * wide :]
    rise, standing = held[RISE * tall * wide : INVERSE * tall * wide], (contacts, gear, scratch_for(contacts))
    statistics = np.empty(high * PLANE_STATISTICS * LANES, np.float32)
    plane, found = np.empty(high * PLANE * LANES, np.float32), np.empty(MOST_SAMPLED, np.float32)
    marks, n, changed = np.empty((4, high), np.uint64), 0, 0
    some, own, todo, now = marks[0], marks[1], marks[2], marks[3]
    before = np.empty(LANES, np.float32), np.empty(LANES, np.uint8)
    for r in range(row0, row1, high):
        for c in range(col0, col1, COLS):
            any_, count, level, asked = NONE, min(high, row1 - r), np.float32(0), NONE
            for j in range(high):
                todo[j] = word_at(dirty, edge + r + j, edge + c) & LOW32 if j < count else NONE
                asked |= todo[j]
            if asked == NONE:
                continue
            for j in range(high):
                some[j] = word_at(covered, edge + r + j, edge + c) if j < count else NONE
                any_ |= some[j]
            if any_ != NONE:
                level = middle_height(cells, edge - k + r, edge - k + c, tall, COLS + 2 * k, found)
                if np.isnan(level):
                    any_ = NONE
            patch = (r - row0) // high, (c - col0) // COLS
            if level != levels[patch]:
                todo[:count], asked, levels[patch] = LOW32, LOW32, level
            if any_ != NONE:
                gather_cells(flat, cols, edge - k + r, edge - k + c, tall, wide, level, held)
                over_rows(held, high, k, wide, sums, rises)
            for g in range(0, min(COLS, col1 - c), LANES):
                shift, fits = np.uint64(g), False
                if (asked >> shift) & LOW16 == NONE:
                    continue
                for j in range(high):
                    own[j], now[j] = (some[j] >> shift) & LOW16, (todo[j] >> shift) & LOW16
                    fits |= any_ != NONE and own[j] != NONE
                if fits:
                    fit_planes(sums, rises, lower, upper, wide, g, away, own, now, limits, statistics, plane)
                for j in range(count):
                    if now[j] == NONE:
                        continue
                    n += LANES
                    here, first = (r - row0 + j) * stride + c - col0 + g, j * PLANE_STATISTICS * LANES
                    certainties = A_CERTAINTY * layer + to + here
                    at = (edge + r + j) * cols + edge + c + g
                    store(maps, A_HEIGHT * layer + to + here, load(flat, HEIGHT * rows * cols + at))
                    store(maps, A_TOP * layer + to + here, load(flat, TOP * rows * cols + at))
                    for i in range(LANES):
                        before[0][i] = maps[certainties + i]
                        before[1][i] = states[place + here + i]
                    if fits:
                        hidden = word_at(unseen, edge + r + j, edge + c + g) & LOW16
                        doubtful = classify(
                            statistics, first, hidden, slope_limit, relief_limit, quarters,
                            maps, to + here, layer, states, place + here,
                        )  # fmt: skip
                        if doubtful != NONE:
                            add_inner_relief(lower, upper, j, g, wide, away, plane, statistics)
                            certainty_of_doubtful(
                                statistics, first, doubtful, slope_limit, relief_limit, quarters,
                                maps, certainties,
                            )  # fmt: skip
                        if contacts.shape[0] > 0:
                            refuse_without_heading(
                                statistics, first, plane, j * PLANE * LANES,
                                (lower, rise, upper, wide, j + k, g + k), cell_m, standing,
                                now[j], before, maps, certainties, states, place + here,
                            )  # fmt: skip
                    else:
                        leave_unknown(maps, to + here, layer, states, place + here)
                    for i in range(LANES):
                        changed += states[place + here + i] != before[1][i]
    return n, changed


@kernel
def derive_tiles(
    cells: Array3D[np.float32],
    covered: Bits,
    unseen: Bits,
    edge: int,
    radius: int,
    limits: Limits,
    contacts: Contacts,
    gear: GearLimits,
    pool: Array4D[np.float32],
    states: Array4D[np.uint8],
    levels: Array3D[np.float32],
    table: Table,
    row0: int,
    col0: int,
    dirty: Bits,
) -> tuple[int, int]:
    """Derive the maps of all cells but a margin, and write them to those of their tiles that are held.

    Return how many were derived, and of how many the state changed.

    Parameters
    ----------
    pool, states, levels, table
        (slots, layers, TILE, TILE), (slots, 1, TILE, TILE) and (slots, TILE / 2, TILE / COLS), and the slots
        of all tiles that the box touches, -1 for none.
    row0, col0
        South-west corner of the box, in the rows and columns of the tiling.
    dirty
        Cells that may change, with a margin as the others have.
    """
    n, changed, high = 0, 0, rows_of_patch(radius)
    rows, cols = cells.shape[1] - 2 * edge, cells.shape[2] - 2 * edge
    maps, flat_states, size = pool.ravel(), states.ravel(), TILE * TILE
    for tr in range(table.shape[0]):
        south = (((row0 >> TILE_BITS) + tr) << TILE_BITS) - row0
        for tc in range(table.shape[1]):
            slot, west = table[tr, tc], (((col0 >> TILE_BITS) + tc) << TILE_BITS) - col0
            if slot < 0:
                continue
            box = max(0, south), min(rows, south + TILE), max(0, west), min(cols, west + TILE)
            at = (box[0] - south) * TILE + box[2] - west
            derived = derive_box(
                cells, covered, unseen, edge, radius, limits, contacts, gear, box,
                maps, slot * pool.shape[1] * size + at, size, TILE, flat_states, slot * size + at, dirty,
                levels[slot][(box[0] - south) // high :, (box[2] - west) // COLS :],
            )  # fmt: skip
            n, changed = n + derived[0], changed + derived[1]
    return n, changed


@kernel
def add_altered(bits: Bits, before: Bits, edge: int, is_complement: bool, dirty: Bits) -> None:
    """Add the cells whose bit is another than before; `before` has no margin, and may be the complement."""
    flipped = ALL if is_complement else NONE
    for r in range(before.shape[0]):
        for w in range(before.shape[1]):
            word = word_at(bits, edge + r, edge + 64 * w) ^ before[r, w] ^ flipped
            or_word(dirty, edge + r, edge + 64 * w, word)
