"""What stands around a landing point: obstacles with their heights, and how free each way in is.

SLZ thesis §4.4.5 lists the obstacles around the selected landing point and leaves the choice of an approach
to the pilot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.frame import LocalFrame
from slz.grid import Box, Grid
from slz.kernels.bits import Bits
from slz.kernels.groups import largest_groups
from slz.kernels.horizon import horizon

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


def grouped(
    raised: Bits,
    tops_m: Callable[[NDArray[np.int32]], NDArray[np.float32]],
    ground_m: Callable[[Box, int, int], float],
    grid: Grid,
    box: Box,
    most: int,
) -> tuple[Obstacle, ...]:
    """Return an obstacle for each group of touching raised cells of a box, the largest groups only.

    Parameters
    ----------
    raised
        Cells of the box that belong to an obstacle.
    tops_m
        Heights of the highest returns of (n, 2) cells within the arrays.
    ground_m
        Height of the ground of a group, given its box and its highest cell, both within the arrays.
    """
    groups, cells = largest_groups(raised, most)
    tops = np.nan_to_num(tops_m(cells), nan=-np.inf)
    centres = grid.centres(cells + np.array([box.row0, box.col0]))
    centres.flags.writeable = False
    found = []
    for *place, first, stop in groups.tolist():
        highest = first + int(np.argmax(tops[first:stop]))
        (row, col), (east, north), top = (
            cells[highest].tolist(),
            centres[highest].tolist(),
            float(tops[highest]),
        )
        over = top - ground_m(Box(*place), row, col)
        found.append(Obstacle(east, north, top, over, centres[first:stop], grid.cell_m))
    return tuple(found)


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
