"""Terrain maps: copies of the maps for zone identification and for output."""

from __future__ import annotations

from collections.abc import Mapping
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

    layers: by name, see `slz.terrain.layers`; heights are up in the map frame. state: 0 unsafe, 1 safe, 255
    unknown.
    """

    frame: LocalFrame
    grid: Grid
    box: Box
    layers: Mapping[str, NDArray[np.float32]]
    state: NDArray[np.uint8]

    @property
    def height_m(self) -> NDArray[np.float32]:
        """DSM, up in the map frame."""
        return self.layers["height_m"]

    @property
    def slope_deg(self) -> NDArray[np.float32]:
        """Slope of the plane of the footprint."""
        return self.layers["slope_deg"]

    @property
    def slope_sigma_deg(self) -> NDArray[np.float32]:
        """Standard error of the slope; NaN in source mode."""
        return self.layers["slope_sigma_deg"]

    @property
    def roughness(self) -> NDArray[np.float32]:
        """RMS residual about the footprint's plane (m); in source mode gradient of the slope (degrees)."""
        return self.layers["roughness"]

    @property
    def relief_m(self) -> NDArray[np.float32]:
        """Peak to peak about the plane of the footprint; NaN in source mode."""
        return self.layers["relief_m"]

    @property
    def certainty(self) -> NDArray[np.float32]:
        """Probability that the whole footprint is safe, 0 where unknown; in source mode 1 or 0."""
        return self.layers["certainty"]

    @property
    def west_m(self) -> float:
        return self.grid.west_m + self.box.col0 * self.grid.cell_m

    @property
    def south_m(self) -> float:
        return self.grid.south_m + self.box.row0 * self.grid.cell_m
