"""Maps as GridMap, read as grid_map reads them: index (0, 0) is the north-east corner, x along the rows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.flight.ros2.grid_map_message import grid_map, nothing_known
from slz import LocalFrame, TerrainMaps
from slz.grid import Box, Grid

AT_NS = 1_750_000_000_123_456_789
ROWS, COLS = 3, 4
CELL_M = 0.5


def maps() -> TerrainMaps:
    """Return three rows and four columns, from 10.5 m east and 21 m north."""
    height = np.arange(ROWS * COLS, dtype=np.float32).reshape(ROWS, COLS)
    slope = np.full((ROWS, COLS), 45.0, np.float32)
    roughness = np.full((ROWS, COLS), 0.02, np.float32)
    state = np.ones((ROWS, COLS), np.uint8)
    state[0, 0], state[2, 3] = 0, 255
    layers = {"height_m": height, "slope_deg": slope, "roughness": roughness}
    return TerrainMaps(
        LocalFrame(47.0, 8.0, 400.0), Grid(10.0, 20.0, CELL_M, 9, 9), Box(2, 5, 1, 5), layers, state
    )


def at(message: Any, layer: str, east_m: float, north_m: float) -> float:
    """Return a layer's value at a position, as grid_map does (getIndexFromPosition, at)."""
    array = message.data[message.layers.index(layer)]
    matrix = eigen(array)
    info = message.info
    middle = info.pose.position
    i = math.floor((info.length_x / 2 - (east_m - middle.x)) / info.resolution)
    j = math.floor((info.length_y / 2 - (north_m - middle.y)) / info.resolution)
    assert (message.outer_start_index, message.inner_start_index) == (0, 0)
    return float(matrix[i, j])


def eigen(array: Any) -> NDArray[np.float32]:
    """Return a layer as an Eigen matrix, which grid_map stores by columns."""
    first, second = array.layout.dim
    assert (first.label, second.label) == ("column_index", "row_index")
    assert (first.stride, second.stride) == (first.size * second.size, second.size)
    return np.reshape(array.data, (second.size, first.size), order="F")


def test_each_cell_is_where_it_is_on_the_ground() -> None:
    made, message = maps(), grid_map(maps(), AT_NS)
    for row in range(ROWS):
        for col in range(COLS):
            east_m, north_m = made.west_m + (col + 0.5) * CELL_M, made.south_m + (row + 0.5) * CELL_M
            assert at(message, "elevation", east_m, north_m) == made.height_m[row, col]
    assert at(message, "elevation", 10.75, 21.25) == 0.0  # the south-western cell
    assert at(message, "elevation", 12.25, 21.25) == 3.0


def test_layers_have_ros_units_and_unknown_is_nan() -> None:
    message = grid_map(maps(), AT_NS)
    assert list(message.layers) == ["elevation", "slope", "roughness", "safe"]
    assert list(message.basic_layers) == ["elevation"]
    assert at(message, "slope", 11.0, 21.6) == np.float32(math.pi / 4)
    assert at(message, "roughness", 11.0, 21.6) == np.float32(0.02)
    assert at(message, "safe", 11.3, 21.6) == 1.0
    assert at(message, "safe", 10.75, 21.25) == 0.0
    assert math.isnan(at(message, "safe", 12.25, 22.25))
    info = message.info
    assert (info.resolution, info.length_x, info.length_y) == (0.5, 2.0, 1.5)
    assert (message.header.frame_id, message.header.stamp.nanosec) == ("map", 123_456_789)


def test_a_withdrawn_map_knows_nothing() -> None:
    message = nothing_known(AT_NS)
    assert all(np.isnan(layer.data).all() and len(layer.data) == 1 for layer in message.data)
