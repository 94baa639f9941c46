"""Protocol of terrain maps: what landing points, obstacles and local heights read of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box, Grid
from slz.kernels.cells.cell_record import TILE
from slz.surface.surface_kinds import UNKNOWN_SURFACE, SurfaceHere
from slz.terrain.footing import ANY_FOOTING, Footing
from slz.terrain.layers import Output, reaching
from slz.terrain.terrain_maps import SAFE, UNKNOWN, UNSAFE
from slz.tile_slots import Key

Floats = NDArray[np.float32]
DISPLAYED = tuple(layer.name for layer in reaching(Output.PAGE))


class TerrainView(Protocol):
    """Maps of a grid."""

    @property
    def grid(self) -> Grid: ...

    def layer(self, name: str, box: Box) -> Floats:
        """Return a copy of one of `LAYERS` over a box, NaN where unknown."""

    def state(self, box: Box) -> NDArray[np.uint8]:
        """Return 0 unsafe, 1 safe, 255 unknown for a box."""

    def around(self, cell: Box, reach: int) -> Box:
        """Return the box within `reach` cells of a cell, as far as the map extends."""

    def state_at(self, enu_m: NDArray[np.float64], error_m: float) -> int | None:
        """Return the state of a point (3,) that may be missed by an error; None where the map lacks it."""

    def footing_at(self, enu_m: NDArray[np.float64], error_m: float) -> Footing:
        """Return the footing of the gear at a point (3,) that may be missed by an error."""

    def certainty_at(self, enu_m: NDArray[np.float64], error_m: float) -> float:
        """Return the certainty of a point (3,) that may be missed by an error."""

    def surface_at(self, enu_m: NDArray[np.float64], around_m: float) -> SurfaceHere:
        """Return what the ground within a distance of a point (3,) is."""

    def ground_and_top(self, box: Box) -> tuple[Floats, Floats]:
        """Return mean heights and tops of the cells of a box (m), NaN where unknown."""


class DisplayedTerrain(TerrainView, Protocol):
    """Terrain maps that displays follow tile by tile."""

    serial: int
    changed_tiles: set[Key]

    @property
    def seen(self) -> Box: ...

    @property
    def corner_m(self) -> tuple[float, float]: ...

    def mark_all_changed(self) -> None: ...

    def tile(
        self, key: Key, names: tuple[str, ...]
    ) -> tuple[list[NDArray[np.float32]], NDArray[np.uint8]] | None: ...

    def maps_at_level(self, level: int) -> DisplayedTerrain:
        """Return the maps at a level of the resolution pyramid."""

    def prepare(self) -> None:
        """Have memory ready for the next window."""


def cells_within(grid: Grid, enu_m: NDArray[np.float64], error_m: float) -> Box:
    """Return the cells where a point (3,) may be that is missed by an error."""
    east, north = enu_m[:2].tolist()
    row0, col0 = grid.index(east - error_m, north - error_m)
    row1, col1 = grid.index(east + error_m, north + error_m)
    return Box(row0, row1 + 1, col0, col1 + 1)


class UnboundedTerrain:
    """Base of terrain maps that extend beyond their grid and have unknown cells."""

    def around(self: TerrainView, cell: Box, reach: int) -> Box:
        """Return the box within `reach` cells of a cell."""
        return Box(cell.row0 - reach, cell.row1 + reach, cell.col0 - reach, cell.col1 + reach)

    def state_at(self: TerrainView, enu_m: NDArray[np.float64], error_m: float) -> int | None:
        """Return the state of a point: safe only where every cell within the error is safe."""
        state = self.state(cells_within(self.grid, enu_m, error_m))
        if (state == SAFE).all():
            return int(SAFE)
        if (state == UNSAFE).any():
            return int(UNSAFE)
        return int(UNKNOWN) if (state == SAFE).any() else None

    def footing_at(self, enu_m: NDArray[np.float64], error_m: float) -> Footing:
        """Return a footing at any heading: maps without evidence of cells know no other."""
        return ANY_FOOTING

    def surface_at(self, enu_m: NDArray[np.float64], around_m: float) -> SurfaceHere:
        """Return an unknown surface: maps without evidence of surfaces know no other."""
        return UNKNOWN_SURFACE

    def certainty_at(self: TerrainView, enu_m: NDArray[np.float64], error_m: float) -> float:
        """Return the certainty of a point: the least of the cells within the error."""
        return float(self.layer("certainty", cells_within(self.grid, enu_m, error_m)).min())

    def ground_and_top(self: TerrainView, box: Box) -> tuple[Floats, Floats]:
        """Return mean heights, and tops where the ground is not safe."""
        height, top = self.layer("height_m", box), self.layer("top_m", box)
        return height, np.where(self.state(box) == SAFE, height, np.fmax(height, top))


@dataclass(frozen=True, slots=True, eq=False)
class DrawnTile:
    """Displayed layers of one tile, (TILE, TILE) each, by name; see `TerrainMaps`."""

    key: Key
    layers: Mapping[str, NDArray[np.float32]]
    state: NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """Part of the changes of a map.

    serial: of the map; after a change of it all earlier tiles are invalid. west_m, south_m: corner of tile
    (0, 0). tiles: present contents. gone: keys of tiles that were dropped. left: number of changed tiles not
    included.
    """

    serial: int
    west_m: float
    south_m: float
    cell_m: float
    tiles: tuple[DrawnTile, ...]
    gone: tuple[Key, ...]
    left: int


def read_changes(terrain: DisplayedTerrain, most: int, around_enu_m: NDArray[np.float64]) -> Drawn:
    """Return copies of the tiles that changed and mark them as seen; the nearest to a point first.

    Parameters
    ----------
    most
        Bound on the tiles returned, and so on the time: 1.3 MB and half a millisecond for 20 tiles.
    around_enu_m
        (2,) or (3,) east, north; where it is not finite the order is arbitrary.
    """
    changed, cell_m = terrain.changed_tiles, terrain.grid.cell_m
    west_m, south_m = terrain.corner_m
    keys = list(changed)
    if len(keys) > most:
        row, col = (around_enu_m[1] - south_m) / (TILE * cell_m), (around_enu_m[0] - west_m) / (TILE * cell_m)
        if math.isfinite(row + col):
            keys.sort(key=lambda key: math.hypot(key[0] + 0.5 - row, key[1] + 0.5 - col))
        keys = keys[:most]
    changed.difference_update(keys)
    tiles, gone = [], []
    for key in keys:
        found = terrain.tile(key, DISPLAYED)
        if found is None:
            gone.append(key)
        else:
            layers, state = found
            tiles.append(DrawnTile(key, dict(zip(DISPLAYED, layers, strict=True)), state))
    return Drawn(terrain.serial, west_m, south_m, cell_m, tuple(tiles), tuple(gone), len(changed))
