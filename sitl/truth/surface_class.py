"""True surface class of every cell, and the height of roofs above the ground around them, for evaluation."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sitl.truth.truth import Extent
from sitl.world.primitives import Box, Kind
from sitl.world.world import World

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]

ROOF_LEAST_M = 2.0
AROUND_M = 1.0
"""Distance from a roof's walls at which the ground around it is measured."""
_PER_SIDE = 16


class SurfaceClass(IntEnum):
    """Surface of the top of a place."""

    OUTSIDE = 0
    BARE = 1
    """Ground, paved or not, lawn, meadow, snow, and puddles up to 5 cm deep."""
    WATER = 2
    ROOF = 3
    LOW_VEGETATION = 4
    """Crops and reed, 0.3 m and higher."""
    CANOPY = 5
    OBJECT = 6
    """Cars, walls, poles, rocks and other things on the ground."""


class SurfaceMap(NamedTuple):
    """Rasters (row = y, from the south) of one extent, of the places of cell centres."""

    surface: U8
    """`SurfaceClass`."""
    roof_height_m: F32
    """Of roofs above the mean ground around their building, NaN elsewhere."""


_OF_KIND = {
    Kind.NOTHING: SurfaceClass.OUTSIDE,
    Kind.WATER: SurfaceClass.WATER,
    Kind.FOLIAGE: SurfaceClass.CANOPY,
    Kind.MAIZE: SurfaceClass.LOW_VEGETATION,
    Kind.WHEAT: SurfaceClass.LOW_VEGETATION,
    Kind.REED: SurfaceClass.LOW_VEGETATION,
}
_CLASS: U8 = np.array([_OF_KIND.get(kind, SurfaceClass.BARE) for kind in Kind], np.uint8)
_ROOFS = (Kind.ROOF, Kind.GRAVEL, Kind.BITUMEN, Kind.SNOW)


def surface_map(world: World, extent: Extent, cell_m: float = 0.2) -> SurfaceMap:
    """Classify every cell of an extent.

    Parameters
    ----------
    world
        Movers count at their current places.
    extent
        (x_min, y_min, x_max, y_max), metres; cells fill it from its south-west corner.
    cell_m
        Side of a cell.
    """
    x0, y0, x1, y1 = extent
    columns, rows = int(np.floor((x1 - x0) / cell_m + 1e-9)), int(np.floor((y1 - y0) / cell_m + 1e-9))
    if columns < 1 or rows < 1:
        raise ValueError(f"truth: extent {extent} holds no cell of {cell_m} m")
    x, y = np.meshgrid(x0 + (np.arange(columns) + 0.5) * cell_m, y0 + (np.arange(rows) + 0.5) * cell_m)
    z, kind = world.surface(x, y)
    surface = _CLASS[kind]
    bare, _ = World(world.ground, layers=world.layers).surface(x, y)
    surface[(z > bare + 1e-6) & (surface == SurfaceClass.BARE)] = SurfaceClass.OBJECT
    roof_height = np.full(z.shape, np.nan, np.float32)
    for solid in world.solids:
        if isinstance(solid, Box) and solid.kind in _ROOFS:
            height = solid.z_m + solid.height_m - _ground_around_m(world, solid)
            if height >= ROOF_LEAST_M:
                top = _inside(solid, x, y) & (np.abs(z - solid.z_m - solid.height_m) < 1e-6)
                surface[top], roof_height[top] = SurfaceClass.ROOF, height
    return SurfaceMap(surface, roof_height)


def _turned(box: Box, x: F64, y: F64) -> tuple[F64, F64]:
    c, s = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
    return c * (x - box.x_m) + s * (y - box.y_m), c * (y - box.y_m) - s * (x - box.x_m)


def _inside(box: Box, x: F64, y: F64) -> NDArray[np.bool_]:
    along, across = _turned(box, x, y)
    inside: NDArray[np.bool_] = (np.abs(along) <= box.length_m / 2) & (np.abs(across) <= box.width_m / 2)
    return inside


def _ground_around_m(world: World, box: Box) -> float:
    """Return the mean height of the bare ground around a building."""
    half_x, half_y = box.length_m / 2 + AROUND_M, box.width_m / 2 + AROUND_M
    share = np.linspace(-1.0, 1.0, _PER_SIDE)
    ones = np.ones(_PER_SIDE)
    along = half_x * np.concatenate([share, share, ones, -ones])
    across = half_y * np.concatenate([ones, -ones, share, share])
    c, s = np.cos(box.yaw_rad), np.sin(box.yaw_rad)
    z, _ = World(world.ground).surface(box.x_m + c * along - s * across, box.y_m + s * along + c * across)
    return float(np.nanmean(z))
