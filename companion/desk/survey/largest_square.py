"""Centre of the largest square of a zone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz import SAFE, Grid, TerrainMaps, Zone
from slz.kernels.polygons.contour import squares


def square_centre(zone: Zone, maps: TerrainMaps) -> tuple[float, float]:
    """Return east and north of the centre of the largest square of the zone's safe cells.

    Of equal squares the one nearest to the zone's landing point is used. The maps' box must hold the zone.
    """
    down, right = zone.box.row0 - maps.box.row0, zone.box.col0 - maps.box.col0
    rows, cols = zone.cells.shape
    safe = (maps.state[down : down + rows, right : right + cols] == SAFE) & (zone.cells == 1)
    return centre_of(zone, safe.astype(np.uint8), maps.grid)


def centre_of(zone: Zone, safe: NDArray[np.uint8], grid: Grid) -> tuple[float, float]:
    """Return the centre of the largest square, given the zone's safe cells within its box."""
    side = squares(np.ascontiguousarray(safe))
    largest = int(side.max())
    last_row, last_col = np.nonzero(side == largest)
    # A square ends with its last row and column, so its centre is half a side before their far edge.
    north = grid.south_m + (last_row + 1 - largest / 2 + zone.box.row0) * grid.cell_m
    east = grid.west_m + (last_col + 1 - largest / 2 + zone.box.col0) * grid.cell_m
    nearest = int(np.argmin((east - zone.best.enu_m[0]) ** 2 + (north - zone.best.enu_m[1]) ** 2))
    return float(east[nearest]), float(north[nearest])
