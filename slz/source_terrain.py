"""Terrain models by the sources' rules to the letter (SLZ paper §3.2), unsafe ones included.

Deviations that the sources' gaps force: a cell's slope also needs the cell's own elevation, and the maps
hold NaN where the paper's hold nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from params import Parameters
from slz.grid import Box, Grid, overlap
from slz.kernels.gradient import gradient_slope_deg
from slz.kernels.scatter import box_of, sum_and_count
from slz.maps import SAFE, UNKNOWN, UNSAFE


class SourceTerrain:
    """Total DSM, slope, roughness and binary map of one zone, filled with the worst case."""

    def __init__(self, grid: Grid, parameters: Parameters) -> None:
        self.grid = grid
        self._parameters = parameters
        shape = grid.rows, grid.cols
        worst = np.float32(parameters.max_slope_deg)
        self.height_m = np.full(shape, np.nan, np.float32)
        self.slope_deg = np.full(shape, worst)
        self.roughness = np.full(shape, worst)
        self.binary = np.zeros(shape, np.uint8)
        self.seen = Box(0, 0, 0, 0)

    def add(self, points_enu_m: NDArray[np.float64]) -> Box:
        """Fuse one window of points; return the box that changed.

        The sources ask neither where the sensor was nor how old a map is.
        """
        grid, p = self.grid, self._parameters
        edges = np.array([0, grid.rows, 0, grid.cols])
        *hit, inside = box_of(points_enu_m, grid.west_m, grid.south_m, grid.cell_m, edges).tolist()
        if not inside:
            return Box(0, 0, 0, 0)
        box = Box(*hit)
        height = self._window_dsm(points_enu_m, box)
        slope = gradient_slope_deg(height, grid.cell_m)
        roughness = gradient_slope_deg(slope, grid.cell_m)
        self._fuse(box, height, slope, roughness)
        self._update_binary(box, p.safe_slope_deg)
        self.seen = self.seen.union(box)
        return box

    def _window_dsm(self, points: NDArray[np.float64], box: Box) -> NDArray[np.float32]:
        """Mean height of every cell of the box (SLZ paper Eq. 5)."""
        total, count = np.zeros(box.shape), np.zeros(box.shape, np.int32)
        g = self.grid
        sum_and_count(points, g.west_m, g.south_m, g.cell_m, box.row0, box.col0, total, count)
        with np.errstate(invalid="ignore"):
            return (total / count).astype(np.float32)

    def _fuse(
        self,
        box: Box,
        height: NDArray[np.float32],
        slope: NDArray[np.float32],
        roughness: NDArray[np.float32],
    ) -> None:
        """Join a window with the total maps, by mean or maximum (SLZ paper §3.2.3).

        Only slopes below the maximum are written: that is the source's rule, and it is unsafe.
        """
        join = np.maximum if self._parameters.fusing == "max" else _mean
        worst = np.float32(self._parameters.max_slope_deg)
        total_slope = self.slope_deg[box.slices]
        total_height = self.height_m[box.slices]
        total_rough = self.roughness[box.slices]
        write = slope < worst
        fresh = write & (total_slope >= worst)
        old = write & ~fresh
        total_slope[old] = join(total_slope[old], slope[old])
        total_height[old] = join(total_height[old], height[old])
        total_slope[fresh] = slope[fresh]
        total_height[fresh] = height[fresh]
        rough = write & ~np.isnan(roughness)
        first = rough & (fresh | (total_rough == worst))
        again = rough & ~first
        total_rough[again] = join(total_rough[again], roughness[again])
        total_rough[first] = roughness[first]

    def _update_binary(self, box: Box, safe_slope_deg: float) -> None:
        """Mark cells below the threshold, leaving the unsafe margin around the map (SLZ paper §3.2.4)."""
        self.binary[box.slices] = self.slope_deg[box.slices] < np.float32(safe_slope_deg)
        self.binary[0], self.binary[-1], self.binary[:, 0], self.binary[:, -1] = 0, 0, 0, 0

    def moved(self, grid: Grid) -> SourceTerrain:
        """Return the maps of a new zone, the common part copied (SLZ paper §3.2.5)."""
        new = SourceTerrain(grid, self._parameters)
        mine, theirs = overlap(self.grid, grid)
        for name in ("height_m", "slope_deg", "roughness", "binary"):
            getattr(new, name)[theirs.slices] = getattr(self, name)[mine.slices]
        new._update_binary(theirs, self._parameters.safe_slope_deg)
        new.seen = theirs
        return new

    def safe(self, box: Box) -> NDArray[np.uint8]:
        """Return 1 for the safe cells of a box, else 0."""
        return self.binary[box.slices].copy()

    def state(self, box: Box) -> NDArray[np.uint8]:
        """Return 0 unsafe, 1 safe, 255 unknown for a box."""
        known = ~np.isnan(self.height_m[box.slices])
        return np.where(self.binary[box.slices] == 1, SAFE, np.where(known, UNSAFE, UNKNOWN)).astype(np.uint8)

    def layer(self, name: str, box: Box) -> NDArray[np.float32]:
        """Return a copy of a map over a box, NaN where unknown; the sources know no relief.

        Certainty is 1 for a safe cell, else 0: the sources have one of zones only.
        """
        if name == "certainty":
            return self.binary[box.slices].astype(np.float32)
        known = ~np.isnan(self.height_m[box.slices])
        values = getattr(self, name, None)
        if values is None:
            return np.full(box.shape, np.nan, np.float32)
        return np.where(known, values[box.slices], np.float32(np.nan))


def _mean(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.float32(0.5) * (a + b)
