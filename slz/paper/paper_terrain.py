"""Terrain models by the sources' rules, unsafe ones included (SLZ paper, section 3.2).

Two deviations fill gaps of the sources: a slope also needs the cell's own elevation, and the maps hold NaN
where the paper leaves cells undefined.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Box, Grid, overlap
from slz.kernels.array_memory import demand_zeros, prefault_range
from slz.kernels.paper.fuse import WORD, fuse, refresh
from slz.kernels.paper.point_pass import MOST_CELLS
from slz.kernels.raster.bitmap import unpacked
from slz.paper.window_cells import WindowCells
from slz.surface.surface_kinds import UNKNOWN_SURFACE, SurfaceHere
from slz.terrain.footing import ANY_FOOTING, Footing
from slz.terrain.terrain_maps import SAFE, UNKNOWN, UNSAFE
from slz.terrain.tiles import SERIALS
from slz.tile_slots import Key, box_of_tile, keys_over

SIDE = 64  # cells of a block
Blocks = NDArray[np.object_]
UNKNOWN_POSITION = np.full(3, np.nan)
EMPTY_BOX = Box(0, 0, 0, 0)
MARGIN_CELLS = 32  # margin in cells around the expected next window
MOST_CELLS_PER_RETURN = (
    4  # cells of a window's box with margin for each return, above which some returns are far off
)
Map = NDArray[np.float32]


class BlockCopies:
    """Block copies of a map, each made on the first read after a change.

    Parameters
    ----------
    values
        (blocks, rows, SIDE) the map, cell (r, c) at [c // SIDE, r, c % SIDE].
    """

    def __init__(self, values: NDArray[np.float32]) -> None:
        self._values = values
        shape = -(-values.shape[1] // SIDE), len(values)
        self._blocks: Blocks = np.full(shape, None, object)
        self._copied = np.zeros(shape, bool)

    def change(self, box: Box) -> None:
        """Mark the cells of a box as changed."""
        blocks = _blocks_of(box)
        self._blocks[blocks] = None
        self._copied[blocks] = False

    def of(self, box: Box, wanted: NDArray[np.bool_]) -> Blocks:
        """Return the blocks that cover a box; wanted ones are up to date, others may be old or None."""
        rows, cols = _blocks_of(box)
        missing = (wanted & ~self._copied[rows, cols]).nonzero()
        for down, right in zip(*(index.tolist() for index in missing), strict=True):
            row, col = rows.start + down, cols.start + right
            self._blocks[row, col] = self._values[col, SIDE * row : SIDE * (row + 1)].copy()
        self._copied[rows, cols] |= wanted
        return self._blocks[rows, cols].copy()


def joined(blocks: Blocks, box: Box) -> NDArray[np.float32]:
    """Return the rows of a box, in columns of whole blocks, from the blocks that cover it; NaN elsewhere."""
    first, rows = box.row0 // SIDE * SIDE, box.shape[0]
    out = np.full((SIDE * blocks.shape[0], SIDE * blocks.shape[1]), np.nan, np.float32)
    for (down, right), block in np.ndenumerate(blocks):
        if block is not None:
            out[SIDE * down :, SIDE * right :][: len(block), :SIDE] = block
    return out[box.row0 - first :][:rows]


def heights_at(blocks: Blocks, box: Box, cells: NDArray[np.int32]) -> NDArray[np.float32]:
    """Return the values at (n, 2) rows and columns of the map, from the blocks that cover a box."""
    rows, cols = cells.T
    which = (rows // SIDE - box.row0 // SIDE) * blocks.shape[1] + cols // SIDE - box.col0 // SIDE
    order = np.argsort(which, kind="stable")
    out = np.empty(len(cells), np.float32)
    for part in np.split(order, np.flatnonzero(np.diff(which[order])) + 1):
        out[part] = blocks.flat[which[part[0]]][rows[part] % SIDE, cols[part] % SIDE]
    return out


def _blocks_of(box: Box) -> tuple[slice, slice]:
    return (
        slice(box.row0 // SIDE, (box.row1 - 1) // SIDE + 1),
        slice(box.col0 // SIDE, (box.col1 - 1) // SIDE + 1),
    )


class PaperTerrain:
    """Total DSM, slope, roughness and binary map of one zone, filled with the worst case.

    The maps start as demand-zero memory. A word of 64 cells is set to the worst case when the first window
    reaches it, so that time and memory follow the ground seen.

    heights, slopes, roughs: (words, rows, 64), cell (r, c) at [c >> 6, r, c & 63], see `fuse`.

    safe_bits, known_bits: (rows, words) bitmaps of the safe cells and of those with an elevation. blocks:
    (rows, words, 2) sums of slope and roughness over the safe cells of a word. changed: box of the cells
    whose safety changed since `pop_changed_box`.
    """

    def __init__(self, grid: Grid, parameters: Parameters) -> None:
        if max(grid.rows, grid.cols) > MOST_CELLS:
            raise ValueError(
                f"a map has {MOST_CELLS} cells along a side at most, not {max(grid.rows, grid.cols)}"
            )
        self.grid = grid
        self._parameters = parameters
        self._worst = np.float32(parameters.worst_slope_deg)
        self._limit = np.float32(parameters.safe_slope_deg)
        words = (grid.cols + 63) // 64 + 1
        self.heights, self.slopes, self.roughs = (
            demand_zeros((words, grid.rows, 64), np.float32) for _ in "hsr"
        )
        self.height_copies = BlockCopies(self.heights)
        self.begun = demand_zeros((grid.rows, words), np.uint8)
        self.safe_bits, self.known_bits = (demand_zeros((grid.rows, words), np.uint64) for _ in "sk")
        self.blocks = demand_zeros((grid.rows, words, 2), np.int32)
        self.seen = self.changed = EMPTY_BOX
        self._last: tuple[Box, ...] = ()  # boxes of the last two windows, from which the next is predicted
        self.serial = next(SERIALS)
        self.changed_tiles: set[Key] = set()

    @property
    def corner_m(self) -> tuple[float, float]:
        """West and south edge of tile (0, 0)."""
        return self.grid.west_m, self.grid.south_m

    def add(self, points_enu_m: NDArray[np.float64]) -> Box:
        """Fuse one window of points; return the box of the cells hit.

        The sources use neither the sensor's position nor the age of a map.
        """
        returns = WindowCells()
        returns.read(points_enu_m, UNKNOWN_POSITION, math.inf, self.grid)
        self.fuse(returns)
        return returns.box if returns.n > returns.n_outside else EMPTY_BOX

    def fuse(self, returns: WindowCells) -> int:
        """Fuse the returns of a window placed in this grid; return how many were used."""
        p, grid, box = self._parameters, self.grid, returns.whole
        if returns.n == returns.n_outside:
            return len(returns.kept())
        sums, unit_m, count_bits, used = returns.sums()
        changed = fuse(
            sums, box.row0, box.col0 // WORD, *box.shape, grid.cols, returns.low_m, unit_m,
            count_bits, grid.cell_m, self._worst, self._limit, p.fusing == "max",
            self.heights, self.slopes, self.roughs, self.begun, self.safe_bits, self.known_bits, self.blocks,
        )  # fmt: skip
        self.height_copies.change(box)
        self.seen = self.seen.union(returns.box)
        area = math.prod(side + 2 * MARGIN_CELLS for side in returns.box.shape)
        dense = area <= MOST_CELLS_PER_RETURN * (returns.n - returns.n_outside)
        self._last = (*self._last[-1:], returns.box) if dense else ()
        self.changed = self.changed.union(Box(*changed))
        self.changed_tiles.update(keys_over(returns.box))
        return used

    def prepare(self) -> None:
        """Prefault the memory of the next window's box, predicted at constant velocity."""
        if not self._last:
            return
        box, before = self._last[-1], self._last[0]
        down = (box.row0 - before.row0 + box.row1 - before.row1) // 2
        right = (box.col0 - before.col0 + box.col1 - before.col1) // 2
        ahead = Box(box.row0 + down, box.row1 + down, box.col0 + right, box.col1 + right)
        ahead = ahead.grown(MARGIN_CELLS, self.grid)
        if ahead.empty:
            return
        rows, words = slice(ahead.row0, ahead.row1), _words(ahead)
        for values in (self.heights, self.slopes, self.roughs):
            prefault_range(values, words, rows)
        for bits in (self.begun, self.safe_bits, self.known_bits, self.blocks):
            prefault_range(bits, rows, words)

    def pop_changed_box(self) -> Box:
        """Return the box in which the safety of cells changed since the last call."""
        box, self.changed = self.changed, EMPTY_BOX
        return box

    def moved(self, grid: Grid) -> PaperTerrain:
        """Return the maps of a new zone, with the common part copied (SLZ paper, section 3.2.5)."""
        new = PaperTerrain(grid, self._parameters)
        mine, theirs = overlap(self.grid, grid)
        if theirs.empty:
            return new
        for name, empty in (("heights", math.nan), ("slopes", self._worst), ("roughs", self._worst)):
            part = np.where(self._begun_cells(mine), _read(getattr(self, name), mine), np.float32(empty))
            _write(getattr(new, name), theirs, part, np.float32(empty))
        words = _words(theirs)
        new.begun[theirs.row0 : theirs.row1, words] = 1
        refresh(
            theirs.row0, theirs.row1, words.start, words.stop, grid.cols, self._limit,
            new.heights, new.slopes, new.safe_bits, new.known_bits, new.blocks,
        )  # fmt: skip
        new.seen = new.changed = theirs
        new.changed_tiles.update(keys_over(theirs))
        return new

    # ---- maps out ------------------------------------------------------------------------------

    def safe(self, box: Box) -> NDArray[np.uint8]:
        """Return 1 for the safe cells of a box, else 0."""
        return self._cells(self.safe_bits, box)

    def state(self, box: Box) -> NDArray[np.uint8]:
        """Return 0 unsafe, 1 safe, 255 unknown for a box."""
        known = np.where(self._cells(self.known_bits, box) == 1, UNSAFE, UNKNOWN)
        return np.where(self.safe(box) == 1, SAFE, known).astype(np.uint8)

    def layer(self, name: str, box: Box) -> NDArray[np.float32]:
        """Return a copy of a map over a box, NaN where unknown; relief is always NaN: the sources have none.

        Certainty is 1 for a safe cell, else 0: the sources define it for zones only.
        """
        if name == "certainty":
            return self.safe(box).astype(np.float32)
        values = {"height_m": self.heights, "slope_deg": self.slopes, "roughness": self.roughs}.get(name)
        if values is None:
            return np.full(box.shape, np.nan, np.float32)
        known = self._cells(self.known_bits, box) == 1
        return np.where(known, _read(values, box), np.float32(np.nan))

    def around(self, cell: Box, reach: int) -> Box:
        """Return the box within `reach` cells of a cell, within the grid: nothing is known outside."""
        return cell.grown(reach, self.grid)

    def state_at(self, enu_m: NDArray[np.float64], error_m: float) -> int | None:
        """Return the state of the cell of a point, unsafe where it is not safe; None outside the window."""
        row, col = self.grid.index(float(enu_m[0]), float(enu_m[1]))
        if self.seen.empty or not self.grid.holds(row, col):
            return None
        return int(SAFE if self.safe(Box(row, row + 1, col, col + 1))[0, 0] == 1 else UNSAFE)

    def footing_at(self, enu_m: NDArray[np.float64], error_m: float) -> Footing:
        """Return a footing at any heading: the sources know no gear."""
        return ANY_FOOTING

    def surface_at(self, enu_m: NDArray[np.float64], around_m: float) -> SurfaceHere:
        """Return an unknown surface: the sources define none."""
        return UNKNOWN_SURFACE

    def certainty_at(self, enu_m: NDArray[np.float64], error_m: float) -> float:
        """Return the certainty of the cell of a point."""
        row, col = self.grid.index(float(enu_m[0]), float(enu_m[1]))
        return float(self.layer("certainty", Box(row, row + 1, col, col + 1))[0, 0])

    def ground_and_top(self, box: Box) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the heights of a box twice, NaN outside the grid: the sources know no tops."""
        rows, cols = self.grid.rows, self.grid.cols
        inner = Box(max(0, box.row0), min(rows, box.row1), max(0, box.col0), min(cols, box.col1))
        height = np.full(box.shape, np.nan, np.float32)
        if not inner.empty:
            there = (
                slice(inner.row0 - box.row0, inner.row1 - box.row0),
                slice(inner.col0 - box.col0, inner.col1 - box.col0),
            )
            height[there] = self.layer("height_m", inner)
        return height, height

    def maps_at_level(self, _level: int) -> PaperTerrain:
        """Return these maps: they have one level."""
        return self

    def mark_all_changed(self) -> None:
        """Mark every tile seen as changed."""
        self.changed_tiles.update(keys_over(self.seen))

    def tile(self, key: Key, names: Sequence[str]) -> tuple[list[NDArray[np.float32]], NDArray[np.uint8]]:
        """Return copies of some maps of a tile, and its state; unknown beyond the grid."""
        box = box_of_tile(key)
        inner = Box(box.row0, min(box.row1, self.grid.rows), box.col0, min(box.col1, self.grid.cols))
        beyond = tuple((0, side - own) for side, own in zip(box.shape, inner.shape, strict=True))
        layers = [np.pad(self.layer(name, inner), beyond, constant_values=np.nan) for name in names]
        return layers, np.pad(self.state(inner), beyond, constant_values=UNKNOWN)

    @property
    def height_m(self) -> NDArray[np.float32]:
        """The total DSM, NaN where nothing was written."""
        return self._whole(self.heights, np.nan)

    @property
    def slope_deg(self) -> NDArray[np.float32]:
        """The total slope map, the worst case where nothing was written."""
        return self._whole(self.slopes, self._parameters.worst_slope_deg)

    @property
    def roughness(self) -> NDArray[np.float32]:
        """The total roughness map, the worst case where nothing was written."""
        return self._whole(self.roughs, self._parameters.worst_slope_deg)

    @property
    def binary(self) -> NDArray[np.uint8]:
        """The binary map, 1 where safe."""
        return self.safe(self.grid.everything)

    def _whole(self, values: Map, empty: float) -> NDArray[np.float32]:
        everything = self.grid.everything
        return np.where(self._begun_cells(everything), _read(values, everything), np.float32(empty))

    def _begun_cells(self, box: Box) -> NDArray[np.bool_]:
        cols = np.arange(box.col0, box.col1) // 64
        return np.asarray(self.begun[box.row0 : box.row1][:, cols] == 1)

    @staticmethod
    def _cells(bits: NDArray[np.uint64], box: Box) -> NDArray[np.uint8]:
        if box.empty:
            return np.zeros(box.shape, np.uint8)
        words = np.ascontiguousarray(bits[box.row0 : box.row1, _words(box)])
        return np.ascontiguousarray(unpacked(words, box.col0 & 63, box.col1 - box.col0))


def _words(box: Box) -> slice:
    """Return the words of a row that cover a non-empty box."""
    return slice(box.col0 >> 6, ((box.col1 - 1) >> 6) + 1)


def _read(values: Map, box: Box) -> NDArray[np.float32]:
    """Return (rows, cols) of a box of a map: a view where it is in one word of each row, else a copy."""
    if box.empty:
        return np.zeros(box.shape, np.float32)
    cells = values[_words(box), box.row0 : box.row1].transpose(1, 0, 2).reshape(box.shape[0], -1)
    return cells[:, box.col0 & 63 :][:, : box.shape[1]]


def _write(values: Map, box: Box, part: NDArray[np.float32], empty: np.float32) -> None:
    """Write (rows, cols) to a box of a map; the rest of its words becomes `empty`."""
    words = _words(box)
    wide = np.full((box.shape[0], 64 * (words.stop - words.start)), empty)
    wide[:, box.col0 & 63 :][:, : box.shape[1]] = part
    values[words, box.row0 : box.row1] = wide.reshape(box.shape[0], -1, 64).transpose(1, 0, 2)
