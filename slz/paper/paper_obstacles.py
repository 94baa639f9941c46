"""Obstacles of a zone in source mode."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box, Grid
from slz.landing_point.obstacles import Obstacle
from slz.paper.snapshots import Blocks, joined
from slz.zones.description import obstacles_of
from slz.zones.tile_view import TileView

Bits = NDArray[np.uint64]


def source_obstacles(holes: Bits, own: Bits, height_m: Blocks, box: Box, grid: Grid) -> tuple[Obstacle, ...]:
    """Return groups of the measured unsafe cells inside a contour, with heights over the zone around them.

    The sources define no such obstacles.

    Parameters
    ----------
    holes, own
        (rows, words) bitmaps of the unsafe cells and of the zone's own safe ones, from the word of the box's
        first column on.
    height_m
        Blocks of the total DSM that cover the box.
    """
    first, heights = box.col0 >> 6 << 6, joined(height_m, box)
    corner = grid.west_m + first * grid.cell_m, grid.south_m + box.row0 * grid.cell_m
    cells = Box(0, heights.shape[0], 0, heights.shape[1])

    def layer(_: str, whole: Box) -> NDArray[np.float32]:
        below = whole.shape[0] - len(heights)
        return np.pad(heights, ((0, below), (0, 0)), constant_values=np.nan)

    view = TileView.copied(layer, cells, 0, "height_m", "top_m")
    found, _ = obstacles_of(view, cells, own, holes, Grid(*corner, grid.cell_m, *cells.shape))
    return found.over(0.0)
