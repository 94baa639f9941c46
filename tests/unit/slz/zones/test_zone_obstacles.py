"""Height of a zone's obstacles over the zone's own ground around them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from slz.grid import Box, Grid
from slz.kernels.raster.bitmap import packed
from slz.kernels.raster.zone_views import zone_obstacles
from slz.terrain.terrain_maps import SAFE
from slz.terrain.terrain_view import UnboundedTerrain
from slz.zones.tile_view import TileView

ROWS, COLS = 12, 90
NOTHING_KNOWN = np.zeros((0, 0), bool), np.empty((0, 6), np.int64), np.empty(0)


@dataclass
class Maps(UnboundedTerrain):
    """Two maps, and nothing beyond them."""

    grid: Grid
    height_m: NDArray[np.float32]
    top_m: NDArray[np.float32]

    def layer(self, name: str, box: Box) -> NDArray[np.float32]:
        wide = np.pad(getattr(self, name), 64, constant_values=np.nan)
        return np.asarray(wide[box.row0 + 64 : box.row1 + 64, box.col0 + 64 : box.col1 + 64])

    def state(self, box: Box) -> NDArray[np.uint8]:
        return np.full(box.shape, SAFE, np.uint8)


def test_an_obstacle_s_height_is_over_the_known_ground_of_the_zone_around_it() -> None:
    """Left the ground is at 10 m, right at 20 m, between at 90 m, but no ground of the zone's."""
    height = np.full((ROWS, COLS), 10.0, np.float32)
    height[:, 60:], height[:, 30:60] = 20.0, 90.0
    own = np.ones((ROWS, COLS), bool)
    own[:, 30:60] = False
    height[4, 9] = height[5, 71] = np.nan  # safe between returns
    holes = np.zeros((ROWS, COLS), bool)
    top = height.copy()
    for row, col, up in ((5, 10, 13.0), (6, 70, 20.5)):
        holes[row, col], own[row, col], height[row, col], top[row, col] = True, False, 99.0, up
    terrain = Maps(Grid(0.0, 0.0, 0.5, ROWS, COLS), height, top)
    view = TileView.copied(terrain.layer, Box(0, ROWS, 0, 128), 0, "height_m", "top_m")
    bits = packed(own.view(np.uint8)), packed(holes.view(np.uint8))
    _, cells, highest, tops_m, grounds_m = zone_obstacles(*view[:5], 0, 0, *bits, 9, 3, *NOTHING_KNOWN)
    assert cells[highest].tolist() == [[5, 10], [6, 70]]
    assert (tops_m - grounds_m).tolist() == pytest.approx([3.0, 0.5])
