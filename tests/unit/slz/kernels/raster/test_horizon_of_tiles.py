"""Horizon from tiles: that of the copied layers, in the sector towards a direction and the two beside it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

import params
from slz.grid import Box, Grid
from slz.kernels.polygons.boundary_tracing import trace_boundary
from slz.kernels.raster.bitmap import packed
from slz.kernels.raster.distance_transform import greatest_clearance
from slz.landing_point.obstacles import SECTORS, horizon_at
from slz.terrain.terrain import EvidenceTerrain
from slz.terrain.terrain_maps import SAFE


def terrain_with_walls(rng: np.random.Generator, rough_m: float) -> EvidenceTerrain:
    p = params.load("quadcopter", ["zone_m=80"])
    terrain = EvidenceTerrain(Grid.centred(3.0, -2.0, 80.0, p.cell_m), p)
    at = rng.uniform(-22, 22, (40_000, 2))
    at = at[np.hypot(*at.T) > 2.5 if rough_m > 0.2 else np.hypot(*(at - 9).T) > 4]
    up = rng.normal(0, rough_m, len(at)) + np.where(rng.random(len(at)) < 0.01, rng.uniform(0, 6, len(at)), 0)
    terrain.add(np.column_stack([at, up]), np.array([0.0, 0.0, 30.0]), 0.0)
    terrain.tiles.datum_m = 0.37
    return terrain


@pytest.mark.parametrize("rough_m", [0.01, 0.3])
@pytest.mark.parametrize("degrees", range(0, 360, 24))
def test_the_horizon_ahead_is_that_of_the_layers(rough_m: float, degrees: int) -> None:
    rng = np.random.default_rng(degrees)
    terrain = terrain_with_walls(rng, rough_m)
    towards = (np.sin(np.radians(degrees)), np.cos(np.radians(degrees)))
    point = np.array([*rng.uniform(-3, 3, 2), 0.5])
    row, col = terrain.grid.index(float(point[0]), float(point[1]))
    box = Box(row - 90, row + 91, col - 80, col + 81)
    height, top = terrain.layer("height_m", box), terrain.layer("top_m", box)
    view = np.where((terrain.state(box) == SAFE) | np.isnan(top), height, top)
    wanted = horizon_at(point, view, terrain.grid, box, 1.0, 15.0)
    found = np.degrees(terrain.horizon(point, box, 1.0, 15.0, SECTORS, towards))
    ahead = round(degrees / 360 * SECTORS)
    sectors = [(ahead + k) % SECTORS for k in (-1, 0, 1)]
    assert np.array_equal(found, np.nanmax(wanted[sectors]), equal_nan=True)


# Boundary tracing of a component, independent of its columns' position in the bitmap's words.


ROWS, COLS = 9, 11


def toured(part: np.ndarray, east: int) -> tuple[list[list[int]], int]:  # type: ignore[type-arg]
    wide = np.zeros((ROWS + 2, 200), np.uint8)
    wide[1:-1, east : east + COLS] = part
    path, edges = np.empty((4 * part.size, 2), np.int32), np.empty(4 * part.size, np.uint8)
    first = int(np.argmax(part[0]))
    n, area = trace_boundary(packed(wide), 1, east + first, path, edges)
    return (path[:n] - [1, east]).tolist(), area


@pytest.mark.parametrize("seed", range(12))
def test_a_tour_does_not_depend_on_where_words_begin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    part = (rng.random((ROWS, COLS)) < 0.62).astype(np.uint8)
    part[0, int(rng.integers(COLS))] = 1
    label, _ = ndimage.label(part, np.ones((3, 3)))
    part[label != label[0, int(np.argmax(part[0]))]] = 0
    path, area = toured(part, 5)
    on_edge = part.astype(bool) & ~ndimage.binary_erosion(part, border_value=0)
    assert all(on_edge[row, col] for row, col in path)
    for east in (*range(50, 67), 118, 126, 127, 128):
        assert toured(part, east)[0] == path
    filled = ndimage.binary_fill_holes(part)
    assert area == toured(filled.astype(np.uint8), 60)[1] == filled.sum()


# Order of cells equally far from everything unsafe: all are returned, by rows, then columns.


def test_the_middles_of_equal_squares_come_by_rows_and_then_by_columns() -> None:
    corners = [(2, 190), (3, 10), (20, 130), (21, 60), (21, 190), (22, 1)]
    part = np.zeros((45, 230), np.uint8)
    for row, col in corners:
        part[row : row + 5, col : col + 5] = 1
    for hints in np.empty((0, 2), np.int64), np.array([[4, 192], [0, 0], [-9, 500], [21, 4]]):
        found = greatest_clearance(packed(part), 5, hints)
        assert found[:, :2].tolist() == [[row + 2, col + 2] for row, col in corners]
        assert (found[:, 2] == 9).all()
