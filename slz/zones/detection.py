"""Zone detection: from the binary map to candidate zones (SLZ paper, section 3.3 and Algorithm 1)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box, Grid
from slz.kernels.polygons.boundary_tracing import trace_boundary
from slz.kernels.raster.bitmap import Bits, packed, unpacked
from slz.kernels.raster.connected_components import components, put_without_small_parts
from slz.kernels.raster.distance_transform import largest_square
from slz.kernels.raster.morphology import erode_to_side
from slz.kernels.raster.region_fill import fill

LEAST_TRACE = 4096  # boundary cells that fit at least
SMALL_PART = 9  # cells, below which a part of a zone that touches the rest at a corner only is left out


@dataclass(frozen=True, slots=True)
class Candidate:
    """Component of the binary map: its traced boundary and the cells on and inside it.

    boundary_cells: (n, 2) rows, columns of the grid. box: bounding box. content_bits: cells on and inside the
    contour, (rows, words). own_bits: its own safe cells. first: bit of a row's first word for the box's first
    column. square_side: cells.
    """

    boundary_cells: NDArray[np.int32]
    box: Box
    content_bits: Bits
    own_bits: Bits
    first: int
    square_side: int

    @property
    def words_box(self) -> Box:
        """Box of the cells that the bitmaps cover."""
        col0 = self.box.col0 - self.first
        return Box(self.box.row0, self.box.row1, col0, col0 + 64 * self.own_bits.shape[1])

    def same_as(self, other: Candidate) -> bool:
        """Return whether another candidate of the same grid holds the same cells."""
        mine, its = ((c.box, c.own_bits.tobytes(), c.content_bits.tobytes()) for c in (self, other))
        return mine == its and self.boundary_cells.tobytes() == other.boundary_cells.tobytes()

    @property
    def content(self) -> NDArray[np.uint8]:
        """The content as bytes over the box."""
        return unpacked(self.content_bits, self.first, self.box.shape[1])

    @property
    def component(self) -> NDArray[np.uint8]:
        """Its own cells as bytes over the box."""
        return unpacked(self.own_bits, self.first, self.box.shape[1])


def side_in_cells(side_m: float, grid: Grid) -> int:
    """Return the number of cells for a side in metres, rounded up."""
    return max(1, math.ceil(side_m / grid.cell_m - 1e-9))


def search_components(
    safe: NDArray[np.uint8], box: Box, least_side: int, least_boundary: int
) -> Iterator[Candidate]:
    """Yield the candidates of `search_bits` in a box.

    Parameters
    ----------
    safe
        (rows, cols) of the box, 1 where safe. Cells outside are unsafe (margin of Algorithm 1).
    """
    return search_bits(packed(np.pad(safe, 1)), box.row0 - 1, box.col0 - 1, least_side, least_boundary)


def search_bits(
    cells: Bits, down: int, right: int, least_side: int, least_boundary: int
) -> Iterator[Candidate]:
    """Yield every 8-connected component that holds a safe square, including islands inside another zone.

    Parameters
    ----------
    cells
        Bitmap of the safe cells; its margin is clear.
    down, right
        Row and column of the first bit.
    """
    if not cells.any():
        return
    squares = cells.copy()  # marked at their south-west corners
    erode_to_side(squares, 1, least_side)
    runs, groups = components(cells, squares)
    path, edges = np.empty((LEAST_TRACE, 2), np.int32), np.empty(LEAST_TRACE, np.uint8)
    for row0, row1, col0, col1, first, stop in groups.tolist():
        run = runs[first:stop]
        while (n := trace_boundary(cells, row0, int(run[0, 1]), path, edges)[0]) > len(path):
            path, edges = np.empty((2 * len(path), 2), np.int32), np.empty(2 * len(path), np.uint8)
        if n < least_boundary:
            continue
        words = slice(col0 >> 6, ((col1 - 1) >> 6) + 1)
        content, own = (np.zeros((row1 - row0, words.stop - words.start), np.uint64) for _ in "co")
        fill(path, edges, n, row0, words.start, content)
        put_without_small_parts(run, SMALL_PART, own)
        corners = own & squares[row0:row1, words]
        if not corners.any():  # the square itself must not be dropped
            put_without_small_parts(run, least_side**2, own)
            corners = own & squares[row0:row1, words]
        yield Candidate(
            boundary_cells=path[:n] + np.array([down, right], np.int32),
            box=Box(row0 + down, row1 + down, col0 + right, col1 + right),
            content_bits=content,
            own_bits=own,
            first=col0 & 63,
            square_side=largest_square(corners, least_side),
        )
