"""Cell arithmetic: whole cells of lengths, cells of a window in the grid, and choice among equal cells."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import params
from params import Parameters
from slz import LocalFrame, Pipeline, PointAttributes, Scan, join
from slz.grid import Box, Grid
from slz.kernels.cells.cell_record import TILE
from slz.kernels.raster.distance_transform import least_steep, most_certain
from slz.terrain.terrain import EvidenceTerrain
from slz.terrain.terrain_maps import UNKNOWN
from slz.terrain.tiles import TILE_BYTES, Tiles
from slz.tile_slots import TileStore
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


# Intensities that tell nothing: absent, constant, saturated, negative, infinite.


FRAME = LocalFrame(47.0, 8.0, 400.0)
MEADOW = np.full(20_000, np.nan, np.float32)


def safe_cells(intensity: np.ndarray[tuple[int, ...], np.dtype[np.float32]], weight: float = 1.0) -> int:
    """Return the number of safe cells of a meadow seen from three places, some rays of which are lost."""
    rng = np.random.default_rng(1)
    pipeline = Pipeline(params.load("quadcopter", ["zone_m=60", "min_boundary_points=10"]), (0.0, 0.0))
    none = np.zeros(len(intensity), np.uint8)
    for k in range(3):
        xy = rng.uniform(-12, 12, (len(intensity), 2))
        points = np.column_stack([xy, 0.02 * xy[:, 0] + rng.normal(0, 0.02, len(xy))])
        sensor = np.array([4.0 * k - 4, 0.0, 12.0])
        lost = np.column_stack([rng.uniform(-12, 12, (9, 2)), np.zeros(9)])
        weights = np.full(9, weight, np.float32)
        told = PointAttributes.of(intensity, none, none, lost, np.tile(sensor, (9, 1)), weights)
        stamps = k * 1_000_000_000 + np.linspace(0, 9e8, len(points)).astype(np.int64)
        pipeline.process(join([Scan(points, stamps, sensor, FRAME, attributes=told)]))
    maps = pipeline.maps(which="near")
    assert maps is not None
    return int((maps.state == 1).sum())


@pytest.mark.parametrize("value", [0.0, 0.01, 1.0, 2.55, -1.0, -np.inf, np.inf, 1e38])
def test_a_constant_intensity_is_unknown(value: float) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert safe_cells(np.full_like(MEADOW, value)) == safe_cells(MEADOW)


@pytest.mark.parametrize("value", [-1.0, np.inf, 1e38])
def test_impossible_intensities_among_others_are_unknown(value: float) -> None:
    bright = np.linspace(0.3, 0.5, len(MEADOW)).astype(np.float32)
    broken = bright.copy()
    broken[::2] = value
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert safe_cells(broken) == safe_cells(bright)


@pytest.mark.parametrize("weight", [np.inf, np.nan, -1e6, 1e6])
def test_lost_rays_of_an_impossible_weight_are_none(weight: float) -> None:
    assert safe_cells(MEADOW, weight) == safe_cells(MEADOW, 0.0)


# Store of tiles: the directory that kernels read says what the dictionary says.


AROUND = Box(-9 * TILE, 9 * TILE, -9 * TILE, 9 * TILE)


def told(store: TileStore) -> dict[tuple[int, int], int]:
    table = store.table(AROUND)
    return {(r - 9, c - 9): int(table[r, c]) for r, c in np.argwhere(table >= 0).tolist()}


@pytest.mark.parametrize("seed", range(4))
def test_tiles_come_and_go_and_each_keeps_its_slot(seed: int) -> None:
    rng, store = np.random.default_rng(seed), TileStore(8)
    for _ in range(600):
        key = (int(rng.integers(-9, 9)), int(rng.integers(-9, 9)))
        if key in store.slot:
            slot = store.slot[key]
            assert store.drop(key) == slot
        else:
            if not store.n_free:
                store.grow_to(2 * store.capacity)
            assert store.take(key) in range(store.capacity)
        assert told(store) == store.slot
        assert len(set(store.slot.values())) == len(store) == store.capacity - store.n_free


def test_tiles_anywhere_are_found() -> None:
    store = TileStore(64)
    keys = [(row, col) for row in (-(2**31), -1, 0, 2**31 - 1) for col in (-(2**31), -7, 3, 2**31 - 1)]
    for key in keys:
        store.take(key)
    for row, col in keys[5:11]:
        box = Box(row * TILE, row * TILE + 1, col * TILE, col * TILE + 1)
        assert store.table(box).tolist() == [[store.slot[row, col]]]


def test_an_empty_box_touches_no_tile() -> None:
    assert TileStore(1).table(Box(0, 0, 0, 0)).size == 0
