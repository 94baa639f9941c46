"""Raster grid of the terrain maps, and boxes of its cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

Edges = tuple[float, float, float, float]
"""West, south, east and north edge of a rectangle (m)."""


@dataclass(frozen=True, slots=True)
class Box:
    """Half-open range of rows and columns."""

    row0: int
    row1: int
    col0: int
    col1: int

    @property
    def shape(self) -> tuple[int, int]:
        return max(0, self.row1 - self.row0), max(0, self.col1 - self.col0)

    @property
    def empty(self) -> bool:
        return self.row1 <= self.row0 or self.col1 <= self.col0

    @property
    def slices(self) -> tuple[slice, slice]:
        return slice(self.row0, self.row1), slice(self.col0, self.col1)

    def holds(self, other: Box) -> bool:
        """Return whether another box is within this one."""
        rows = self.row0 <= other.row0 <= other.row1 <= self.row1
        return rows and self.col0 <= other.col0 <= other.col1 <= self.col1

    def touches(self, other: Box) -> bool:
        """Return whether two boxes have a cell in common."""
        rows = self.row0 < other.row1 and other.row0 < self.row1
        return rows and self.col0 < other.col1 and other.col0 < self.col1

    def shifted(self, down: int, right: int) -> Box:
        return Box(self.row0 + down, self.row1 + down, self.col0 + right, self.col1 + right)

    def relative_to(self, other: Box) -> Box:
        """Return the box with its rows and columns relative to another's corner."""
        return self.shifted(-other.row0, -other.col0)

    def grown(self, cells: int, grid: Grid) -> Box:
        """Return the box with a margin, clipped to the grid."""
        return Box(
            max(0, self.row0 - cells),
            min(grid.rows, self.row1 + cells),
            max(0, self.col0 - cells),
            min(grid.cols, self.col1 + cells),
        )

    def union(self, other: Box) -> Box:
        if self.empty:
            return other
        if other.empty:
            return self
        return Box(
            min(self.row0, other.row0),
            max(self.row1, other.row1),
            min(self.col0, other.col0),
            max(self.col1, other.col1),
        )


def hull(boxes: Sequence[Box]) -> Box:
    """Return the bounding box of boxes."""
    held = [box for box in boxes if not box.empty]
    if not held:
        return Box(0, 0, 0, 0)
    return Box(
        min(box.row0 for box in held),
        max(box.row1 for box in held),
        min(box.col0 for box in held),
        max(box.col1 for box in held),
    )


def common(a: Box, b: Box) -> Box:
    """Return the intersection of two boxes; it may be empty."""
    return Box(max(a.row0, b.row0), min(a.row1, b.row1), max(a.col0, b.col0), min(a.col1, b.col1))


def within(inner: Box, outer: Box) -> tuple[slice, slice]:
    """Return the slices of a box in the array of a box around it."""
    return inner.relative_to(outer).slices


@dataclass(frozen=True, slots=True)
class Grid:
    """Raster of square cells; row 0 is southernmost, column 0 westernmost. Edges in metres, map frame."""

    west_m: float
    south_m: float
    cell_m: float
    rows: int
    cols: int

    @classmethod
    def centred(cls, east_m: float, north_m: float, side_m: float, cell_m: float) -> Self:
        """Return a square grid around a point, snapped to whole cells (SLZ paper, section 3.1.2)."""
        n = max(3, round(side_m / cell_m))
        east, north = round(east_m / cell_m) * cell_m, round(north_m / cell_m) * cell_m
        return cls(east - side_m / 2, north - side_m / 2, cell_m, n, n)

    @property
    def everything(self) -> Box:
        return Box(0, self.rows, 0, self.cols)

    @property
    def east_m(self) -> float:
        return self.west_m + self.cols * self.cell_m

    @property
    def north_m(self) -> float:
        return self.south_m + self.rows * self.cell_m

    def recentred(self, east_m: float, north_m: float) -> Grid:
        """Return a grid of the same cells with a point in its middle (SLZ paper, section 3.2.5)."""
        down, right = self.index(east_m, north_m)
        return replace(
            self,
            west_m=self.west_m + (right - self.cols // 2) * self.cell_m,
            south_m=self.south_m + (down - self.rows // 2) * self.cell_m,
        )

    def index(self, east_m: float, north_m: float) -> tuple[int, int]:
        """Return row and column of a point; they may be outside the grid."""
        return (
            int(np.floor((north_m - self.south_m) / self.cell_m)),  # SLZ paper, Eq. (4)
            int(np.floor((east_m - self.west_m) / self.cell_m)),  # SLZ paper, Eq. (3)
        )

    def holds(self, row: int, col: int) -> bool:
        return 0 <= row < self.rows and 0 <= col < self.cols

    def centre(self, row: float, col: float) -> tuple[float, float]:
        """Return east and north of a cell's centre."""
        return (self.west_m + (col + 0.5) * self.cell_m, self.south_m + (row + 0.5) * self.cell_m)

    def centres(self, rows_cols: NDArray[np.integer]) -> NDArray[np.float64]:
        """Return (n, 2) east, north of the centres of (n, 2) cells."""
        return np.stack(
            [
                self.west_m + (rows_cols[:, 1] + 0.5) * self.cell_m,
                self.south_m + (rows_cols[:, 0] + 0.5) * self.cell_m,
            ],
            axis=1,
        )

    def shift_to(self, other: Grid) -> tuple[int, int]:
        """Return the rows and columns to add to an index of this grid to get that of `other`."""
        return (
            round((self.south_m - other.south_m) / self.cell_m),
            round((self.west_m - other.west_m) / self.cell_m),
        )


def overlap(old: Grid, new: Grid) -> tuple[Box, Box]:
    """Return the common cells of two grids of equal cell size, as a box in each.

    This intersection covers the four sign cases of SLZ paper, Figure 2.
    """
    down, right = old.shift_to(new)
    row0, row1 = max(0, down), min(new.rows, old.rows + down)
    col0, col1 = max(0, right), min(new.cols, old.cols + right)
    if row1 <= row0 or col1 <= col0:
        return Box(0, 0, 0, 0), Box(0, 0, 0, 0)
    return Box(row0 - down, row1 - down, col0 - right, col1 - right), Box(row0, row1, col0, col1)
