"""What stands around a landing point: obstacles with their heights, and how free each way in is.

SLZ thesis 4.4.5 lists the obstacles around the selected landing point and leaves the choice of an approach
to the pilot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.frame import LocalFrame
from slz.grid import Box, Grid
from slz.kernels.raster.bitmap import Bits
from slz.kernels.raster.connected_components import highest, largest_groups
from slz.kernels.raster.horizon import horizon

SECTORS = 36


@dataclass(frozen=True, slots=True, eq=False)
class Obstacle:
    """Something that stands on the ground, in metres of the map frame.

    east_m, north_m: its highest cell. top_m: height of that one's highest return. height_m: that over the
    ground. cells_enu_m: (n, 2) centres of its cells. cell_m: their size.
    """

    east_m: float
    north_m: float
    top_m: float
    height_m: float
    cells_enu_m: NDArray[np.float64]
    cell_m: float

    @property
    def width_m(self) -> float:
        """Side of a square of its area."""
        return float(np.sqrt(len(self.cells_enu_m))) * self.cell_m

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        """Its west, south, east and north edges."""
        west, south = self.cells_enu_m.min(axis=0) - self.cell_m / 2
        east, north = self.cells_enu_m.max(axis=0) + self.cell_m / 2
        return float(west), float(south), float(east), float(north)

    def lla(self, frame: LocalFrame) -> NDArray[np.float64]:
        """Return latitude, longitude (degrees) and altitude (m) of its highest return."""
        return frame.lla([self.east_m, self.north_m, self.top_m])

    def distance_m(self, enu_m: NDArray[np.float64]) -> float:
        """Return the horizontal distance from a point to the nearest of its cells."""
        beyond = np.maximum(np.abs(self.cells_enu_m - enu_m[:2]) - self.cell_m / 2, 0.0)
        return float(np.hypot(*beyond.T).min())


@dataclass(frozen=True, slots=True, eq=False)
class Groups:
    """Groups of touching cells, to be made obstacles of.

    cells: (m, 2) of the grid, group by group. ends: where those of each group begin and stop.
    highest: the place of its highest cell. top_m, height_m: as of `Obstacle`, the top over a datum.
    """

    grid: Grid
    cells: NDArray[np.int32]
    ends: NDArray[np.int64]
    highest: NDArray[np.int64]
    top_m: NDArray[np.float32]
    height_m: NDArray[np.float64]

    def over(self, datum_m: float) -> tuple[Obstacle, ...]:
        """Return the obstacles, their tops in heights of which the datum is given."""
        centres, tops = self.grid.centres(self.cells), self.top_m + np.float32(datum_m)
        centres.flags.writeable = False
        places = centres[self.highest].tolist()
        parts = zip(places, tops.tolist(), self.height_m.tolist(), self.ends.tolist(), strict=True)
        return tuple(
            Obstacle(east, north, top, over, centres[first:stop], self.grid.cell_m)
            for (east, north), top, over, (first, stop) in parts
        )


def grouped(
    raised: Bits,
    tops_m: Callable[[NDArray[np.int32]], NDArray[np.float32]],
    grounds_m: Callable[[NDArray[np.int64], NDArray[np.int32]], NDArray[np.float64]],
    grid: Grid,
    box: Box,
    most: int,
) -> Groups:
    """Return the groups of touching raised cells of a box, the largest only.

    Parameters
    ----------
    raised
        Cells of the box that belong to an obstacle.
    tops_m
        Heights of the highest returns of (n, 2) cells of the grid.
    grounds_m
        Heights of the ground of groups (`largest_groups`), whose highest cells are given.
    """
    groups, cells = largest_groups(raised, most)
    cells[:, 0] += box.row0
    cells[:, 1] += box.col0
    tops = tops_m(cells)
    places = highest(tops, groups)
    top = tops[places]
    top[np.isnan(top)] = -np.inf
    over = top.astype(np.float64) - grounds_m(groups, cells[places])
    return Groups(grid, cells, groups[:, 4:], places, top, over)


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Obstacles within `radius_m` of a point, the nearest first, and the elevation angle of the horizon.

    horizon_deg : (36,) by bearing, clockwise from north; NaN where nothing was seen.
    """

    radius_m: float
    obstacles: tuple[Obstacle, ...]
    horizon_deg: NDArray[np.float64]

    def way_in(self, bearing_rad: float = 0.0) -> tuple[float, float] | None:
        """Return the bearing (rad) to come from and its horizon (deg): the lowest, of equals the least turn.

        Horizons are compared in steps of 2 degrees, over three neighbouring sectors each. None where no
        sector was seen.
        """
        h = self.horizon_deg
        wide = np.max([np.roll(h, -1), h, np.roll(h, 1)], axis=0)  # NaN where one of them is
        bearings = np.arange(SECTORS) * 2 * np.pi / SECTORS
        turn = np.abs((bearings - bearing_rad + np.pi) % (2 * np.pi) - np.pi)
        seen = np.flatnonzero(np.isfinite(wide))
        if not len(seen):
            return None
        best = min(seen.tolist(), key=lambda i: (np.floor(max(wide[i], 0.0) / 2), turn[i]))
        return float(bearings[best]), float(wide[best])


def horizon_at(
    enu_m: NDArray[np.float64],
    top_m: NDArray[np.float32],
    grid: Grid,
    box: Box,
    near_m: float,
    far_m: float,
    towards: tuple[float, float] = (0.0, 0.0),
) -> NDArray[np.float64]:
    """Return (36,) elevation angles (deg) of the horizon of a point, by bearing clockwise from north.

    With a direction, east and north of length 1, only those within 20 degrees of it are worked out.
    """
    row = (enu_m[1] - grid.south_m) / grid.cell_m - 0.5 - box.row0
    col = (enu_m[0] - grid.west_m) / grid.cell_m - 0.5 - box.col0
    angles = horizon(
        np.ascontiguousarray(top_m, np.float32), row, col, enu_m[2], grid.cell_m, near_m, far_m, SECTORS,
        *towards,
    )  # fmt: skip
    return np.degrees(angles)
