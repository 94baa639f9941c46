"""Protocol of terrain maps: what landing points, obstacles and local heights read of them."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box, Grid
from slz.surface.surface_kinds import UNKNOWN_SURFACE, SurfaceHere
from slz.terrain.footing import ANY_FOOTING, Footing
from slz.terrain.terrain_maps import SAFE, UNKNOWN, UNSAFE
from slz.tile_keys import Key

Floats = NDArray[np.float32]


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
    """What terrain maps share that extend beyond their grid, and know unknown cells."""

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
