"""Tile store: random access to the derived maps of a survey over any window."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.desk.survey.tiled import array_file
from companion.desk.survey.tiled.surface_parts import SurfaceParts
from slz import UNKNOWN, Box, Grid
from slz.grid import common, within
from slz.surface.surface_kinds import SurfaceHere
from slz.terrain.layers import NAMED
from slz.terrain.terrain_view import UnboundedTerrain

HELD = 8  # tiles whose files stay mapped: at most 22 MB each, which count as the worker's memory
Key = tuple[int, int]
SURFACES = ("surface", "water")  # layers of the surface: kind, and probability of water


@dataclass(frozen=True, slots=True)
class TileLayout:
    """Layout of the tiles: folder of their files, cells along a side, the survey's box, and the cell size.

    In local metres, the south-west corner of the survey is (0, 0): that of cell (whole.row0, whole.col0).
    """

    folder: Path
    side: int
    whole: Box
    cell_m: float

    @property
    def surface(self) -> SurfaceParts:
        """Surface of the survey: kinds of ground."""
        return SurfaceParts(self.folder.parent / "surface", self.cell_m)

    def path(self, key: Key) -> Path:
        return self.folder / f"{key[0]}_{key[1]}.tile"

    def box(self, key: Key) -> Box:
        row, col = key
        return Box(row * self.side, (row + 1) * self.side, col * self.side, (col + 1) * self.side)

    def held(self, key: Key) -> Box:
        """Return the cells of a tile that are within the survey."""
        return common(self.box(key), self.whole)

    def local(self, box: Box) -> Box:
        """Return a box of the lattice in rows and columns of `grid`."""
        row, col = self.whole.row0, self.whole.col0
        return Box(box.row0 - row, box.row1 - row, box.col0 - col, box.col1 - col)

    def keys(self, box: Box) -> Iterator[Key]:
        """Return the keys of the tiles that a box touches."""
        if box.empty:
            return
        for row in range(box.row0 // self.side, (box.row1 - 1) // self.side + 1):
            for col in range(box.col0 // self.side, (box.col1 - 1) // self.side + 1):
                yield row, col

    @property
    def grid(self) -> Grid:
        """The raster of the whole survey; its row and column 0 are the first of its box."""
        return Grid(0.0, 0.0, self.cell_m, *self.whole.shape)


@dataclass(slots=True)
class Store(UnboundedTerrain):
    """Cached reader of layers over boxes counted from the survey's corner, as in `TileLayout.grid`."""

    layout: TileLayout
    _open: OrderedDict[Key, tuple[Box, dict[str, NDArray[Any]]] | None] = field(default_factory=OrderedDict)

    def tile(self, key: Key) -> tuple[Box, dict[str, NDArray[Any]]] | None:
        """Return a tile's cells (lattice) and its layers; None where there is none."""
        if key in self._open:
            self._open.move_to_end(key)
            return self._open[key]
        path = self.layout.path(key)
        found = None
        if path.exists():
            layers, notes = array_file.read(path)
            found = Box(*notes["box"]), layers
        self._open[key] = found
        if len(self._open) > HELD:
            self._open.popitem(last=False)
        return found

    def read(self, name: str, box: Box) -> NDArray[Any]:
        """Return a copy of a layer over a box; outside all tiles it is empty, and the state 255."""
        whole = self.layout.whole
        wanted = Box(
            box.row0 + whole.row0, box.row1 + whole.row0, box.col0 + whole.col0, box.col1 + whole.col0
        )
        if name in SURFACES:
            surface, row, col = self.layout.surface.over(wanted)
            values: NDArray[Any] = surface.kind if name == "surface" else surface.water
            return np.asarray(values[np.ix_(row, col)])
        state = name == "state"
        empty: Any = UNKNOWN if state else NAMED[name].empty
        out = np.full(box.shape, empty, np.uint8 if state else np.float32)
        for key in self.layout.keys(wanted):
            tile = self.tile(key)
            if tile is None:
                continue
            held, layers = tile
            part = common(held, wanted)
            if not part.empty:
                out[within(part, wanted)] = layers[name][within(part, held)]
        return out

    # ---- terrain interface used by `slz.zones.description.describe` ----------------------------------------

    @property
    def grid(self) -> Grid:
        return self.layout.grid

    def layer(self, name: str, box: Box) -> NDArray[np.float32]:
        return np.asarray(self.read(name, box), np.float32)

    def surface_at(self, enu_m: NDArray[np.float64], around_m: float) -> SurfaceHere:
        whole, cell_m = self.layout.whole, self.layout.cell_m
        row, col = enu_m[1] / cell_m + whole.row0, enu_m[0] / cell_m + whole.col0
        return self.layout.surface.here(float(row), float(col), around_m / cell_m)

    def state(self, box: Box) -> NDArray[np.uint8]:
        return np.asarray(self.read("state", box), np.uint8)
