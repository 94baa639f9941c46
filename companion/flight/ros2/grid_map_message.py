"""Maps as grid_map_msgs/GridMap."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from companion.flight.rmw.message_types import GRID_MAP, message_types
from companion.flight.ros2.frame_messages import header, pose_at
from slz import UNKNOWN, TerrainMaps

ELEVATION = "elevation"
LAYERS = (ELEVATION, "slope", "roughness", "safe")

_make = message_types().make


def grid_map(maps: TerrainMaps, at_ns: int) -> Any:
    """Return the maps as a message: elevation and roughness m, slope rad, safe 1 or 0; NaN where unknown."""
    safe = np.where(maps.state == UNKNOWN, np.nan, maps.state).astype(np.float32)
    slope_rad = np.radians(maps.slope_deg)
    layers = maps.height_m, slope_rad, maps.roughness, safe
    rows, cols = maps.state.shape
    return _message(layers, maps.west_m, maps.south_m, maps.grid.cell_m, (rows, cols), at_ns)


def nothing_known(at_ns: int) -> Any:
    """Return a map of one unknown cell: it replaces a map that is no longer valid."""
    unknown = np.full((1, 1), np.nan, np.float32)
    return _message((unknown,) * len(LAYERS), -0.5, -0.5, 1.0, (1, 1), at_ns)


def _message(
    layers: tuple[NDArray[np.float32], ...],
    west_m: float,
    south_m: float,
    cell_m: float,
    shape: tuple[int, int],
    at_ns: int,
) -> Any:
    rows, cols = shape
    middle = np.array([west_m + cols * cell_m / 2, south_m + rows * cell_m / 2, 0.0])
    info = _make("grid_map_msgs/msg/GridMapInfo", cell_m, cols * cell_m, rows * cell_m, pose_at(middle))
    arrays = [_array(layer) for layer in layers]
    return _make(GRID_MAP, header(at_ns), info, list(LAYERS), [ELEVATION], arrays, 0, 0)


def _array(layer: NDArray[np.float32]) -> Any:
    """Return a layer in grid_map's order: from the north-east corner to the west, then to the south.

    Its matrix has index (0, 0) there, x along its rows, y along its columns, and is stored by columns.
    """
    rows, cols = layer.shape
    dim = "std_msgs/msg/MultiArrayDimension"
    dims = [_make(dim, "column_index", rows, rows * cols), _make(dim, "row_index", cols, cols)]
    data = np.ascontiguousarray(layer[::-1, ::-1], np.float32).ravel()
    return _make("std_msgs/msg/Float32MultiArray", _make("std_msgs/msg/MultiArrayLayout", dims, 0), data)
