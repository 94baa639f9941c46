"""Where in a zone its best point lies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

import params
from slz import Pipeline, Zone
from slz.grid import Box, Grid
from slz.kernels.raster.bitmap import packed
from slz.kernels.raster.zone_views import zone_obstacles
from slz.terrain.terrain_maps import SAFE
from slz.terrain.terrain_view import UnboundedTerrain
from slz.zones.tile_view import TileView
from tests.unit.slz.hand_made import returns, window

Floats = NDArray[np.float64]
CELL_M, SIDE, STRIPE = 0.2, 100, 3
HALF_M = CELL_M * SIDE / 2


def garden(even_cells: int) -> Floats:
    """Paving in stripes, 0.22 m high: safe with little to spare. In the east it is even."""
    out = np.zeros((SIDE, SIDE))
    paved = np.arange(SIDE) // STRIPE % 2 == 1
    out[np.ix_(paved, np.arange(SIDE) < SIDE - even_cells)] = 0.22
    return out


def zone_of(heights: Floats) -> Zone:
    settings = ["min_boundary_points=4", "gear=none"]
    pipe = Pipeline(params.load("quadcopter", settings), (0.0, 0.0), follow=False)
    points = np.repeat(returns(heights, CELL_M, -HALF_M, -HALF_M), 3, axis=0)
    (zone,) = pipe.process(window(points)).near.zones
    return zone


def test_the_point_lies_on_undoubted_ground_where_that_is_wide_enough_for_a_zone() -> None:
    best = zone_of(garden(even_cells=30)).best
    assert HALF_M - 30 * CELL_M < best.enu_m[0] < HALF_M
    assert best.certainty > 0.99
    assert best.clearance_m > 1.5


def test_its_clearance_is_the_distance_to_the_edge_of_the_zone() -> None:
    """Not to less sure ground: zones are ranked by it."""
    heights = garden(even_cells=0)
    heights[20:50, 20:50] = 0.11  # the mean height
    best = zone_of(heights).best
    assert (best.enu_m[:2] < 0.0).all()
    assert best.clearance_m == pytest.approx(HALF_M + best.enu_m[:2].min() - 1.2, abs=2 * CELL_M)


def test_without_such_ground_the_point_is_amid_the_surest_that_there_is() -> None:
    """Paving of 0.23 m; in the east a square of it is 0.22 m high, which is surer."""
    heights = garden(even_cells=0) * 0.23 / 0.22
    heights[30:60, 60:90] *= 0.22 / 0.23
    best = zone_of(heights).best
    assert (np.array([-HALF_M + 62 * CELL_M, -HALF_M + 32 * CELL_M]) < best.enu_m[:2]).all()
    assert (best.enu_m[:2] < np.array([-HALF_M + 88 * CELL_M, -HALF_M + 58 * CELL_M])).all()


def test_without_such_ground_the_point_has_the_greatest_clearance_of_the_zone() -> None:
    best = zone_of(garden(even_cells=10)).best
    assert best.enu_m[:2] == pytest.approx([0.0, 0.0], abs=4.0)
    assert best.clearance_m > 5.0


# Height of a zone's obstacles over the zone's own ground around them.


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
