"""Lengths in whole cells, cells of a window in those of all ground, and which of equal places is taken."""

from __future__ import annotations

import numpy as np
import pytest

from params import Parameters
from slz.evidence import EvidenceTerrain
from slz.grid import Box, Grid
from slz.kernels.room import first_choice
from slz.maps import UNKNOWN
from slz.search import side_in_cells
from slz.tiles import TILE_BYTES, Tiles


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
    slope = np.full((80, 80), 2.0, np.float32)
    place = 20, 20, -10.0, -10.0, 0.5  # the cells count from there
    assert first_choice(cells[:3], slope, *place, *sensor) == chosen
    slope[29, 29] = 2.06  # a tenth of a degree steeper
    assert first_choice(cells, slope, *place, *sensor) == chosen
    slope[29, 29] = 1.0
    assert first_choice(cells, slope, *place, *sensor) == 3
