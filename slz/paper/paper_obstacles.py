"""Obstacles of a zone in source mode."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box, Grid
from slz.kernels.raster.connected_components import obstacles
from slz.landing_point.obstacles import Obstacle
from slz.paper.snapshots import Blocks, joined

MOST_OBSTACLES = 200
AROUND = 3  # cells around an obstacle whose ground its height refers to
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
    first = box.col0 >> 6 << 6
    corner = grid.west_m + first * grid.cell_m, grid.south_m + box.row0 * grid.cell_m
    found, ends, cells = obstacles(
        holes, own, joined(height_m, box), *corner, grid.cell_m, MOST_OBSTACLES, AROUND
    )
    cells.flags.writeable = False
    return tuple(
        Obstacle(east, north, top, over, cells[first:stop], grid.cell_m)
        for (east, north, top, over), (first, stop) in zip(found.tolist(), ends.tolist(), strict=True)
    )
