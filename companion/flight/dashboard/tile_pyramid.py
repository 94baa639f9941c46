"""Tile pyramid of the maps for the page: quantised blocks, encoded on request."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from companion.flight.dashboard import map_block as blocks
from companion.flight.dashboard.map_block import SIDE, Block
from slz import Drawn, DrawnTile
from slz.kernels.cells.cell_record import TILE

LEVELS = 6
Key = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Cell:
    """Map values of one cell: layers by name, None where unknown."""

    cell_m: float
    values: dict[str, float | None]
    state: str


class TilePyramid:
    """Pyramid of one map, near or far.

    Block (row, col) of level k has `SIDE` x `SIDE` cells of 2^k times the map's cell size, counted from the
    map's corner; it contains block (2 row, 2 col) of level k - 1 and its northern and eastern neighbours.

    Attributes
    ----------
    serial
        Serial number of the map; another one clears everything.
    changes
        Finest blocks with the time of their last change, an increasing number.
    """

    def __init__(self) -> None:
        self.serial = 0
        self.west_m = self.south_m = self.cell_m = 0.0
        self.changes: dict[Key, int] = {}
        self._finest: dict[Key, Block] = {}
        self._coarse: dict[tuple[int, int, int], Block] = {}
        self._bytes: dict[tuple[int, int, int], tuple[int, bytes]] = {}
        self._clock = 0

    def apply_changes(self, drawn: Drawn) -> None:
        """Apply the changes of the map."""
        if drawn.serial != self.serial:
            self.serial = drawn.serial
            self.west_m, self.south_m, self.cell_m = drawn.west_m, drawn.south_m, drawn.cell_m
            for held in (self.changes, self._finest, self._coarse, self._bytes):
                held.clear()
        changed = {key for tile in drawn.tiles if (key := self._write(tile)) is not None}
        changed |= {key for gone in drawn.gone if (key := self._clear(gone)) is not None}
        self._clock += bool(changed)
        for key in changed:
            self.changes[key] = self._finest[key].version = self._clock

    def since(self, clock: int) -> list[tuple[int, int, int]]:
        """Return row, column and change time of the finest blocks that changed after a time."""
        return [(*key, at) for key, at in tuple(self.changes.items()) if at > clock]

    @property
    def clock(self) -> int:
        """Time of the last change."""
        return self._clock

    def encoded(self, level: int, row: int, col: int) -> bytes | None:
        """Return a compressed block, None if all of it is unknown."""
        version = self._version(level, row, col)
        if version is None:
            return None
        key = level, row, col
        held = self._bytes.get(key)
        if held is None or held[0] != version:
            block = self._block(level, row, col, version)
            cell_m = self.cell_m * 2**level
            west_m, south_m = self.west_m + col * SIDE * cell_m, self.south_m + row * SIDE * cell_m
            held = self._bytes[key] = version, blocks.encode(block, west_m, south_m, cell_m)
        return held[1]

    def cell(self, east_m: float, north_m: float) -> Cell | None:
        """Return the cell at a point, None outside the drawn blocks."""
        if not self.cell_m:
            return None
        row, col = int((north_m - self.south_m) // self.cell_m), int((east_m - self.west_m) // self.cell_m)
        block = self._finest.get((row // SIDE, col // SIDE))
        if block is None:
            return None
        at = row % SIDE, col % SIDE
        state = {0: "unsafe", 1: "safe"}.get(int(block.state[at]), "unknown")
        return Cell(self.cell_m, blocks.values_at(block, *at), state)

    # ---- parts ----------------------------------------------------------------------------------

    def _write(self, tile: DrawnTile) -> Key | None:
        side = tile.state.shape[0]
        key, row, col = _place(tile.key, side)
        block = self._finest.get(key)
        if block is None:
            block = self._finest[key] = blocks.empty(blocks.base_of(tile.layers[blocks.HEIGHT.name]))
        return key if blocks.write(block, row, col, tile) else None

    def _clear(self, gone: Key) -> Key | None:
        key, row, col = _place(gone, TILE)
        block = self._finest.get(key)
        if block is None:
            return None
        blocks.clear(block, row, col, TILE)
        return key

    def _version(self, level: int, row: int, col: int) -> int | None:
        """Return the time of a block's last change, None if all of it is unknown."""
        rows = range(row << level, (row + 1) << level)
        cols = range(col << level, (col + 1) << level)
        found = [at for r in rows for c in cols if (at := self.changes.get((r, c))) is not None]
        return max(found, default=None)

    def _block(self, level: int, row: int, col: int, version: int) -> Block:
        """Return a block with known cells, rebuilt if it changed."""
        if level == 0:
            return self._finest[row, col]
        held = self._coarse.get((level, row, col))
        if held is None or held.version != version:
            places = {(r, c): (level - 1, 2 * row + r, 2 * col + c) for r in (0, 1) for c in (0, 1)}
            children = {
                quarter: self._block(*place, changed)
                for quarter, place in places.items()
                if (changed := self._version(*place)) is not None
            }
            held = blocks.coarser(children, next(iter(children.values())).base_m)
            held.version = version
            self._coarse[level, row, col] = held
        return held


class TilePyramids:
    """Pyramids of the near and the far map."""

    def __init__(self) -> None:
        self.by_name = {"near": TilePyramid(), "far": TilePyramid()}

    def apply_changes(self, name: str, drawn: Drawn) -> None:
        """Apply the changes of a map."""
        self.by_name[name].apply_changes(drawn)

    def heads(self) -> dict[str, dict[str, Any]]:
        """Return position and size of the maps, for the page."""
        return {
            name: {
                "serial": pyramid.serial,
                "west_m": pyramid.west_m,
                "south_m": pyramid.south_m,
                "cell_m": pyramid.cell_m,
                "side": SIDE,
                "levels": LEVELS,
            }
            for name, pyramid in self.by_name.items()
            if pyramid.serial
        }

    def cell(self, east_m: float, north_m: float) -> tuple[str, Cell] | None:
        """Return the map that knows a point, near map first, and its cell there."""
        for name, pyramid in self.by_name.items():
            found = pyramid.cell(east_m, north_m)
            if found is not None and (found.state != "unknown" or name == "far"):
                return name, found
        return None


def _place(key: Key, side: int) -> tuple[Key, int, int]:
    """Return the block that contains a tile, and the tile's row and column in it."""
    per = SIDE // side
    (block_row, row), (block_col, col) = divmod(key[0], per), divmod(key[1], per)
    return (block_row, block_col), row * side, col * side
