"""SLZ search: from the binary map to zones (SLZ paper §3.3, Algorithm 1)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slz.grid import Box, Grid
from slz.kernels.bits import packed
from slz.kernels.contour import inside, squares, trace
from slz.kernels.groups import components, without_crumbs

TRACE_TIMEOUT = 10_000_000
CRUMB = 9  # cells, below which a part of a zone that hangs on a corner is left out


@dataclass(frozen=True, slots=True)
class Candidate:
    """A component of the binary map: its traced boundary and what lies on or inside it.

    boundary_cells: (n, 2) rows, columns of the grid. box: bounding box. content: uint8 over the box, 1 on and
    inside the contour. component: uint8 over the box, 1 on its own safe cells. square_side: cells.
    """

    boundary_cells: NDArray[np.int32]
    box: Box
    content: NDArray[np.uint8]
    component: NDArray[np.uint8]
    square_side: int


def side_in_cells(side_m: float, grid: Grid) -> int:
    """Return the cells that a side of so many metres needs."""
    return max(1, math.ceil(side_m / grid.cell_m - 1e-9))


def search_components(
    safe: NDArray[np.uint8], box: Box, least_side: int, least_boundary: int
) -> Iterator[Candidate]:
    """Yield every 8-connected component that holds a safe square, islands inside another zone included.

    Parameters
    ----------
    safe
        (rows, cols) of the box, 1 where safe. Beyond it nothing is (Algorithm 1's unsafe margin).
    """
    if not safe.any():
        return
    safe = np.pad(safe, 1)
    side = squares(safe)
    runs, groups = components(packed(safe), side, least_side)
    for *edges, first, stop in groups.tolist():
        own, run = Box(*edges), runs[first:stop]
        boundary = trace(safe, own.row0, int(run[0, 1]), TRACE_TIMEOUT)
        if len(boundary) < least_boundary:
            continue
        component, square_side = without_crumbs(run, side, CRUMB)
        if square_side < least_side:  # the square itself is no crumb
            component, square_side = without_crumbs(run, side, least_side**2)
        candidate = Candidate(
            boundary_cells=boundary,
            box=own,
            content=_content(boundary, own),
            component=component,
            square_side=square_side,
        )
        yield _placed(candidate, box.row0 - 1, box.col0 - 1)


def _placed(candidate: Candidate, row0: int, col0: int) -> Candidate:
    """Return a candidate with its rows and columns counted from elsewhere."""
    box = candidate.box
    return replace(
        candidate,
        boundary_cells=candidate.boundary_cells + np.array([row0, col0], np.int32),
        box=Box(box.row0 + row0, box.row1 + row0, box.col0 + col0, box.col1 + col0),
    )


def _content(boundary: NDArray[np.int32], box: Box) -> NDArray[np.uint8]:
    local = boundary - np.array([box.row0, box.col0], np.int32)
    rows, cols = box.shape
    return inside(local, 1, rows + 2, cols + 2)[1:-1, 1:-1]
