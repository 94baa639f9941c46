"""Obstacles around a landing point, and the horizon for an approach.

SLZ thesis, section 4.4.5 lists the obstacles around the selected landing point and leaves the choice of an
approach to the pilot.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from slz.frame import LocalFrame
from slz.grid import Box, Grid
from slz.kernels.raster.horizon import horizon

SECTORS = 36


@dataclass(frozen=True, slots=True, eq=False)
class Obstacle:
    """Obstacle on the ground: a group of touching cells, in metres of the map frame.

    east_m, north_m: centre of its highest cell. top_m: height of the highest return of that cell. height_m:
    top_m over the ground. cells_enu_m: (n, 2) centres of its cells. cell_m: size of a cell.
    """

    east_m: float
    north_m: float
    top_m: float
    height_m: float
    cells_enu_m: NDArray[np.float64]
    cell_m: float

    @property
    def width_m(self) -> float:
        """Side of a square of equal area."""
        return float(np.sqrt(len(self.cells_enu_m))) * self.cell_m

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        """West, south, east and north edge of the bounding box."""
        west, south = self.cells_enu_m.min(axis=0) - self.cell_m / 2
        east, north = self.cells_enu_m.max(axis=0) + self.cell_m / 2
        return float(west), float(south), float(east), float(north)

    def lla(self, frame: LocalFrame) -> NDArray[np.float64]:
        """Return latitude, longitude (degrees) and altitude (m) of the highest return."""
        return frame.lla([self.east_m, self.north_m, self.top_m])

    def distance_m(self, enu_m: NDArray[np.float64]) -> float:
        """Return the horizontal distance from a point to the obstacle's nearest cell."""
        beyond = np.maximum(np.abs(self.cells_enu_m - enu_m[:2]) - self.cell_m / 2, 0.0)
        return float(np.hypot(*beyond.T).min())


class Obstacles(Sequence[Obstacle]):
    """Obstacles in columns; an `Obstacle` is made when it is read.

    Parameters
    ----------
    cells
        (m, 2) rows and columns in the grid of the obstacles' cells, obstacle by obstacle.
    ends
        (n, 2) start and stop of each obstacle in `cells`.
    highest
        (n,) index of each obstacle's highest cell in `cells`.
    top_m, height_m
        (n,) as in `Obstacle`.
    """

    def __init__(
        self,
        grid: Grid,
        cells: NDArray[np.int32],
        ends: NDArray[np.int64],
        highest: NDArray[np.int64],
        top_m: NDArray[np.float32],
        height_m: NDArray[np.float64],
    ) -> None:
        self._columns = grid, cells, ends, highest
        self._top_m, self._height_m = top_m, height_m

    def over(self, datum_m: float) -> Obstacles:
        """Return the obstacles with a datum added to their tops."""
        return Obstacles(*self._columns, self._top_m + np.float32(datum_m), self._height_m)

    def __len__(self) -> int:
        return len(self._top_m)

    @overload
    def __getitem__(self, index: int, /) -> Obstacle: ...

    @overload
    def __getitem__(self, index: slice, /) -> list[Obstacle]: ...

    def __getitem__(self, index: int | slice, /) -> Obstacle | list[Obstacle]:
        return [*self][index]

    def __iter__(self) -> Iterator[Obstacle]:
        grid, cells, ends, highest = self._columns
        centres = grid.centres(cells)
        centres.flags.writeable = False
        places = centres[highest].tolist()
        parts = zip(places, self._top_m.tolist(), self._height_m.tolist(), ends.tolist(), strict=True)
        for (east, north), top, over, (first, stop) in parts:
            yield Obstacle(east, north, top, over, centres[first:stop], grid.cell_m)


def horizon_at(
    enu_m: NDArray[np.float64],
    top_m: NDArray[np.float32],
    grid: Grid,
    box: Box,
    near_m: float,
    far_m: float,
) -> NDArray[np.float64]:
    """Return (36,) elevation angles (deg) of the horizon at a point, by bearing clockwise from north."""
    row = (enu_m[1] - grid.south_m) / grid.cell_m - 0.5 - box.row0
    col = (enu_m[0] - grid.west_m) / grid.cell_m - 0.5 - box.col0
    top_m = np.ascontiguousarray(top_m, np.float32)
    return np.degrees(horizon(top_m, row, col, enu_m[2], grid.cell_m, near_m, far_m, SECTORS))
