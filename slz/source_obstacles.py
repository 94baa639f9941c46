"""Obstacles of a zone of source mode, worked out when they are first read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np
from numpy.typing import NDArray

from slz.block_copies import Blocks, joined
from slz.grid import Box, Grid
from slz.kernels.groups import obstacles
from slz.surroundings import Obstacle

MOST_OBSTACLES = 200
AROUND = 3  # cells, of the ground that an obstacle's height is over
Bits = NDArray[np.uint64]


class SourceObstacles(Sequence[Obstacle]):
    """The measured unsafe cells inside a contour, in groups; their height is over the zone around them.

    It keeps what it is worked out from, so it is of the moment it was made, whenever it is read. The sources
    have no obstacles of zones, and nothing on the way from a window to its report reads them.

    Parameters
    ----------
    holes, own
        (rows, words) bits of the unsafe cells and of the zone's own safe ones, from the word of the box's
        first column on.
    height_m
        Blocks of the total DSM that hold the box.
    """

    def __init__(self, holes: Bits, own: Bits, height_m: Blocks, box: Box, grid: Grid) -> None:
        first = box.col0 >> 6 << 6
        self._holes, self._own, self._height_m, self._box, self._grid = holes, own, height_m, box, grid
        self._corner = grid.west_m + first * grid.cell_m, grid.south_m + box.row0 * grid.cell_m
        self._found: tuple[Obstacle, ...] | None = None

    @property
    def _all(self) -> tuple[Obstacle, ...]:
        if self._found is None:
            cell_m = self._grid.cell_m
            height_m = joined(self._height_m, self._box)
            found, ends, cells = obstacles(
                self._holes, self._own, height_m, *self._corner, cell_m, MOST_OBSTACLES, AROUND
            )
            cells.flags.writeable = False
            self._found = tuple(
                Obstacle(east, north, top, over, cells[first:stop], cell_m)
                for (east, north, top, over), (first, stop) in zip(found.tolist(), ends.tolist(), strict=True)
            )
        return self._found

    def __len__(self) -> int:
        return len(self._all)

    @overload
    def __getitem__(self, index: int) -> Obstacle: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Obstacle]: ...
    def __getitem__(self, index: int | slice) -> Obstacle | Sequence[Obstacle]:
        return self._all[index]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and self._all == tuple(other)

    def __hash__(self) -> int:
        return id(self)
