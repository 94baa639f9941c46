"""View of a map as tiles, for kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box
from slz.kernels.cells.cell_record import TILE
from slz.kernels.footprint.classify import A_CERTAINTY, A_HEIGHT, A_SLOPE, A_TOP
from slz.terrain.terrain import EvidenceTerrain
from slz.terrain.terrain_view import Floats

NAMES = "height_m", "top_m", "slope_deg", "certainty"  # as `slz.kernels.raster.zone_views` counts them


class TileView(NamedTuple):
    """Layers of a map in tiles, valid until the map changes.

    Layers, table, row, column and places are what `slz.kernels.raster.zone_views` asks for. versions: of the
    tiles, (rows, columns), a new number after every write. datum_m: to be added to heights.
    """

    layers: Floats
    table: NDArray[np.int32]
    row0: int
    col0: int
    places: tuple[int, int, int, int]
    states: NDArray[np.uint8]
    versions: NDArray[np.int64]
    datum_m: float

    @classmethod
    def of(cls, terrain: EvidenceTerrain, box: Box) -> Self:
        """Return the tiles under a box."""
        there, table, versions, pools = terrain.tiles_within(box)
        row0, col0 = box.row0 - there.row0 % TILE, box.col0 - there.col0 % TILE
        places = A_HEIGHT, A_TOP, A_SLOPE, A_CERTAINTY
        return cls(pools.layers, table, row0, col0, places, pools.states, versions, terrain.tiles.datum_m)

    @classmethod
    def copied(cls, read: Callable[[str, Box], Floats], box: Box, margin: int, *names: str) -> Self:
        """Return some of `NAMES` of any map under a box with a margin; the box begins with a tile."""
        beside = -(-margin // TILE)
        rows, cols = (-(-side // TILE) + 2 * beside for side in box.shape)
        row0, col0 = box.row0 - beside * TILE, box.col0 - beside * TILE
        whole = Box(row0, row0 + rows * TILE, col0, col0 + cols * TILE)
        layers = np.empty((rows * cols, len(names), TILE, TILE), np.float32)
        for of, name in enumerate(names):
            tiles = read(name, whole).reshape(rows, TILE, cols, TILE).swapaxes(1, 2)
            layers[:, of] = tiles.reshape(-1, TILE, TILE)
        table = np.arange(rows * cols, dtype=np.int32).reshape(rows, cols)
        height, top, slope, certainty = (names.index(name) if name in names else -1 for name in NAMES)
        places, none = (height, top, slope, certainty), np.empty((0, 1, TILE, TILE), np.uint8)
        return cls(layers, table, row0, col0, places, none, np.empty((0, 0), np.int64), 0.0)

    def tiles_under(self, box: Box) -> tuple[slice, slice]:
        """Return the part of the table under a box whose columns are those of whole tiles."""
        south, west = box.row0 - self.row0, box.col0 - self.col0
        if west % TILE:
            raise ValueError("the words of a candidate must be rows of the terrain's tiles: see `safe_bits`")
        east, north = west + box.shape[1], south + box.shape[0]
        return slice(south // TILE, -(-north // TILE)), slice(west // TILE, east // TILE)
