"""Window returns placed in a map's cells, by the sources' rules (SLZ paper, section 3.2.1)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box, Grid
from slz.kernels.paper.fuse import WORD
from slz.kernels.paper.height_gate import accepted_interval
from slz.kernels.paper.height_sums import sum_heights
from slz.kernels.paper.point_pass import DROPPED, OUTSIDE, place_points

Points = NDArray[np.float64]
FINEST_BITS = 36  # binary digits of a metre to which heights are rounded, at best
SUM_BITS = 51  # bits of a sum of heights, at most
LARGE_SUMS, CELLS_PER_POINT = (
    1 << 22,
    64,
)  # cells of sums, and cells for each point, above which demand-zero memory is used
FAR_OFF_M = 100.0  # distance of the level from the accepted heights; float32 resolves 0.004 mm there


class WindowCells:
    """Returns of a window, 8 bytes each: cell and height. One object serves all windows in turn.

    low_m, high_m: the accepted heights; all until `keep_heights`.
    """

    def __init__(self) -> None:
        self._cells = np.empty(0, np.uint32)
        self._heights = np.empty(0, np.float32)
        self._sums = np.empty(0, np.uint64)
        self.points = np.empty(0)
        self._given: tuple[Points, float, Grid] | None = None
        self.low_m = self.high_m = self._level = 0.0
        self.n = self.n_outside = 0
        self.box = Box(0, 0, 0, 0)

    def read(self, points_enu_m: Points, sensor_enu_m: Points, range_m: float, grid: Grid) -> None:
        """Place points in a grid; drop those not finite or farther than `range_m` from the sensor."""
        n = len(points_enu_m)
        if n > len(self._cells):
            self._cells, self._heights = np.empty(n + n // 4, np.uint32), np.empty(n + n // 4, np.float32)
        self.points = np.ascontiguousarray(points_enu_m).reshape(-1)
        found = self._place(sensor_enu_m, range_m, grid, math.nan)
        self._given = sensor_enu_m, range_m, grid
        self._level, self.low_m, self.high_m = found[:3]
        self.n, self.n_outside = int(found[3]), int(found[4])
        row0, row1, col0, col1 = (int(edge) for edge in found[5:])
        self.box = Box(row0, row1, col0, col1)

    def _place(self, sensor_enu_m: Points, range_m: float, grid: Grid, level_m: float) -> list[float]:
        found: list[float] = place_points(
            self.points, grid.west_m, grid.south_m, grid.cell_m, grid.rows, grid.cols, sensor_enu_m, range_m,
            level_m, self.cells, self.heights,
        ).tolist()  # fmt: skip
        return found

    @property
    def whole(self) -> Box:
        """The box in whole words of the map; it may extend beyond the last column."""
        box = self.box
        return Box(box.row0, box.row1, box.col0 // WORD * WORD, -(-box.col1 // WORD) * WORD)

    @property
    def cells(self) -> NDArray[np.uint32]:
        return self._cells[: len(self.points) // 3]

    @property
    def heights(self) -> NDArray[np.float32]:
        return self._heights[: len(self.points) // 3]

    def keep_heights(self, bins: int, threshold: float) -> None:
        """Accept only the heights in the histogram's interval, see `slz.kernels.paper.height_gate`."""
        if not self.n or self._given is None:
            return
        self.low_m, self.high_m = accepted_interval(
            self.points, self.cells, self.heights, self._level, self.low_m, self.high_m, self.n, bins,
            threshold,
        )  # fmt: skip
        if not self.low_m - FAR_OFF_M <= self._level <= self.high_m + FAR_OFF_M:  # level of a rejected point
            self._level = self.low_m
            self._place(*self._given, self._level)

    def kept(self, every: int = 1) -> Points:
        """Return (m, 3) the accepted ones among every `every`-th point."""
        points = self.points.reshape(-1, 3)[::every]
        height = points[:, 2]
        used = (self.cells[::every] != DROPPED) & (self.low_m <= height) & (height <= self.high_m)
        return np.asarray(points[used])

    def first_outside(self) -> tuple[float, float] | None:
        """Return east and north of the first accepted point outside the grid."""
        if not self.n_outside:
            return None
        points = self.points.reshape(-1, 3)
        height = points[:, 2]
        away = (self.cells == OUTSIDE) & (self.low_m <= height) & (height <= self.high_m)
        where = int(np.argmax(away))
        return (float(points[where, 0]), float(points[where, 1])) if away[where] else None

    def sums(self) -> tuple[NDArray[np.uint64], float, int, int]:
        """Return the sums over whole words (see `sum_heights`), their unit (m), count bits, points used."""
        row0, col0, (rows, width) = self.whole.row0, self.whole.col0, self.whole.shape
        n_cells = rows * width
        if n_cells > max(
            LARGE_SUMS, CELLS_PER_POINT * self.n
        ):  # some points are far apart: untouched pages take no memory
            sums = np.zeros(n_cells, np.uint64)
        else:
            if n_cells > len(self._sums):
                self._sums = np.empty(n_cells + n_cells // 4, np.uint64)
            sums = self._sums[:n_cells]
            sums[:] = 0  # just before the sums are used, so that they are in the cache
        count_bits = max(12, self.n.bit_length())
        span_m = max(self.high_m - self.low_m, 1e-3)
        most = min(SUM_BITS, 63 - count_bits) - math.log2(max(self.n, 1)) - math.log2(span_m)
        scale = 2.0 ** min(FINEST_BITS, math.floor(most))
        given = self.points, self.cells, self.heights, self._level, self.low_m, self.high_m, scale, count_bits
        used = sum_heights(*given, row0, col0, width, sums)
        return sums, 1.0 / scale, count_bits, used
