"""Cell arithmetic: whole cells of lengths, cells of a window in the grid, and choice among equal cells."""

from __future__ import annotations

import numpy as np
import pytest

from params import Parameters
from slz.grid import Box, Grid
from slz.kernels.raster.distance_transform import least_steep, most_certain
from slz.terrain.terrain import EvidenceTerrain
from slz.terrain.terrain_maps import UNKNOWN
from slz.terrain.tiles import TILE_BYTES, Tiles
from slz.zones.detection import side_in_cells


@pytest.mark.parametrize(
    ("side_m", "cell_m", "cells"),
    [(2.0, 0.2, 10), (0.3, 0.1, 3), (1.1, 0.1, 11), (2.05, 0.2, 11), (0.05, 0.2, 1), (0.0, 0.2, 1)],
)
def test_a_side_needs_so_many_whole_cells_whatever_the_rounding(
    side_m: float, cell_m: float, cells: int
) -> None:
    assert side_in_cells(side_m, Grid(0, 0, cell_m, 10, 10)) == cells


@pytest.mark.parametrize("cells", [0, 3, 7, 129])
def test_a_window_s_cells_are_those_of_all_ground_that_many_cells_on(cells: int) -> None:
    """0.2 * 3 is a little more than 0.6, and 0.6 / 0.2 a little less than 3."""
    tiles = Tiles(0.0, 0.0, 0.2, 64 * TILE_BYTES)
    terrain = EvidenceTerrain(Grid(cells * 0.2, -cells * 0.2, 0.2, 300, 300), Parameters(), tiles)
    spot = np.array([cells * 0.2, -cells * 0.2]) + 6.0
    lattice = np.mgrid[-20:20, -20:20].reshape(2, -1).T * 0.1 + 0.05  # four in a cell
    points = np.column_stack([spot + lattice, np.zeros(len(lattice))])
    terrain.add(points, np.array([*spot, 20.0]), 0.0)
    rows, cols = np.nonzero(terrain.state(Box(0, 300, 0, 300)) != UNKNOWN)
    assert rows.min() + rows.max() == cols.min() + cols.max() == 2 * 29.5


@pytest.mark.parametrize(("sensor", "chosen"), [((100.0, 0.0), 1), ((-100.0, 0.0), 0), ((0.0, 100.0), 2)])
def test_of_places_that_slope_alike_the_nearest_to_the_sensor_is_taken(
    sensor: tuple[float, float], chosen: int
) -> None:
    cells = np.array([[5, 5], [5, 50], [50, 5], [9, 9]])
    slope = np.full((2, 80, 64), 2.0, np.float32)
    place = 20, 20, -10.0, -10.0, 0.5  # the cells count from there
    assert least_steep(cells[:3], slope, *place, *sensor) == chosen
    slope[0, 29, 29] = 2.06  # a tenth of a degree steeper
    assert least_steep(cells, slope, *place, *sensor) == chosen
    slope[0, 29, 29] = 1.0
    assert least_steep(cells, slope, *place, *sensor) == 3


def test_the_most_certain_place_is_taken_then_the_least_steep_then_the_nearest() -> None:
    cells = np.array([[5, 5], [5, 50], [50, 5], [9, 9], [40, 40]])
    sure, slope = np.full(5, 0.9, np.float32), np.full(5, 2.0, np.float32)
    place = -10.0, -10.0, 0.5, -7.0, 30.0  # near the third
    assert most_certain(cells, sure, slope, *place) == 2
    slope[:2] = 1.96, 1.94  # the first is as steep as the others, to a tenth of a degree
    assert most_certain(cells, sure, slope, *place) == 1
    sure[:] = 0.9004, 0.8994, 0.8996, 0.9, 0.9  # the second is less certain, to a thousandth
    assert most_certain(cells, sure, slope, *place) == 2
    sure[4] = 0.95
    assert most_certain(cells, sure, slope, *place) == 4
    sure[4], unknown = 0.9, float("nan")  # where the vehicle is: the first of equals
    assert most_certain(cells, sure, slope, *place[:3], unknown, unknown) == 0


def test_of_places_as_near_the_first_is_taken() -> None:
    slope = np.full((1, 60, 64), 2.0, np.float32)
    cells = np.array([[20, 10], [20, 30], [10, 20], [30, 20]])
    assert least_steep(cells, slope, 0, 0, 0.0, 0.0, 1.0, 20.5, 20.5) == 0
    assert least_steep(cells[1:], slope, 0, 0, 0.0, 0.0, 1.0, 20.5, 20.5) == 0
