"""Terrain maps: copies of the maps for zone identification and for output."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.frame import LocalFrame
from slz.grid import Box, Grid
from slz.kernels.cells.cell_record import IS_SAFE, IS_UNKNOWN, IS_UNSAFE

UNSAFE, SAFE, UNKNOWN = IS_UNSAFE, IS_SAFE, IS_UNKNOWN


@dataclass(frozen=True, slots=True)
class TerrainMaps:
    """Copies of the maps over a box of the grid; row 0 is the southernmost. NaN where unknown.

    height_m: DSM, up in the map frame. slope_deg. slope_sigma_deg: its standard error (default mode only).
    roughness: in source mode the gradient of the slope map (degrees), in default mode the rms residual
    about the footprint's plane (m). relief_m: peak to peak about that plane (default mode only). certainty:
    probability that the whole footprint is safe, 0 where unknown; in source mode 1 or 0. state: 0 unsafe, 1
    safe, 255 unknown.
    """

    frame: LocalFrame
    grid: Grid
    box: Box
    height_m: NDArray[np.float32]
    slope_deg: NDArray[np.float32]
    slope_sigma_deg: NDArray[np.float32]
    roughness: NDArray[np.float32]
    relief_m: NDArray[np.float32]
    certainty: NDArray[np.float32]
    state: NDArray[np.uint8]

    @property
    def west_m(self) -> float:
        return self.grid.west_m + self.box.col0 * self.grid.cell_m

    @property
    def south_m(self) -> float:
        return self.grid.south_m + self.box.row0 * self.grid.cell_m
