"""The question that every method answers: a grid, a footprint, limits, and the returns of one flight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]
UNSAFE, SAFE, UNKNOWN = 0, 1, 255
"""States of a cell in safe maps; in a truth, 255 is a cell that is not judged."""


@dataclass(frozen=True, slots=True)
class CellGrid:
    """Square cells in local metres: x east, y north. Rasters are (rows, cols), row 0 the southernmost."""

    west_m: float
    south_m: float
    cell_m: float
    rows: int
    cols: int

    @property
    def shape(self) -> tuple[int, int]:
        return self.rows, self.cols

    def centres(self) -> tuple[F64, F64]:
        """Return x and y of the centres, (rows, cols) each."""
        x = self.west_m + (np.arange(self.cols) + 0.5) * self.cell_m
        y = self.south_m + (np.arange(self.rows) + 0.5) * self.cell_m
        east, north = np.meshgrid(x, y)
        return east, north

    def index(self, x_m: F64, y_m: F64) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Return row, col and the mask of those inside, of coordinates of any shape."""
        col = np.floor((x_m - self.west_m) / self.cell_m + 1e-9).astype(np.int64)
        row = np.floor((y_m - self.south_m) / self.cell_m + 1e-9).astype(np.int64)
        inside = (row >= 0) & (col >= 0) & (row < self.rows) & (col < self.cols)
        return row, col, inside

    def with_cells(self, cell_m: float) -> CellGrid:
        """Return a grid of other cells that covers the same ground."""
        rows, cols = (int(np.ceil(n * self.cell_m / cell_m - 1e-9)) for n in self.shape)
        return CellGrid(self.west_m, self.south_m, cell_m, rows, cols)


@dataclass(frozen=True, slots=True)
class LandingTask:
    """A cell is safe if the whole square footprint about its centre is, by the limits (ADR 39).

    slope_limit_deg: of the best-fit plane of the footprint. relief_limit_m: of the surface, peak to peak
    about that plane. range_noise_m: standard deviation of a range, as the sensor's sheet states it.
    """

    grid: CellGrid
    footprint_m: float = 2.0
    slope_limit_deg: float = 10.0
    relief_limit_m: float = 0.3
    range_noise_m: float = 0.02


@dataclass(frozen=True, slots=True)
class FlownReturns:
    """Returns of one flight in local metres, in the order of their times.

    points_m: (n, 3) x, y, z. stamp_s: (n,). window: (n,) index of the sensor's place. sensors_m: (w, 3);
    NaN where the places are not known.
    """

    points_m: F64
    stamp_s: F64
    window: NDArray[np.int64]
    sensors_m: F64

    def __len__(self) -> int:
        return len(self.points_m)


@dataclass(frozen=True, slots=True)
class SafeMap:
    """Answer of a method on the task's grid.

    state: (rows, cols) uint8, 0 unsafe, 1 safe, 255 unknown. probability: (rows, cols) float32 that the
    footprint is safe, NaN where unknown; None where the method gives none. limit_share: (rows, cols) float32
    of a method of thresholds: the greatest share of one of its limits that a footprint takes up, safe where
    below 1, NaN where unknown. The operating curve moves the threshold of either.
    """

    state: U8
    probability: F32 | None = None
    limit_share: F32 | None = None


class LandingMethod(Protocol):
    """A method of the benchmark. A user's file names it `METHOD`."""

    @property
    def name(self) -> str:
        """Short name, as on the leaderboard."""

    @property
    def source(self) -> str:
        """Publication, and our choices where it leaves them open."""

    def judge(self, returns: FlownReturns, task: LandingTask) -> SafeMap:
        """Return the safe map; must not change its input."""
