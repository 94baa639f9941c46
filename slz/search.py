"""SLZ search: from the binary map to zones (SLZ paper §3.3, Algorithm 1)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from slz.grid import Box, Grid
from slz.kernels.contour import components, flood, inside, squares, trace

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


def search_source(
    safe: NDArray[np.uint8], seen: Box, least_side: int, least_boundary: int
) -> Iterator[Candidate]:
    """Yield zones by the paper's rule: everything inside a contour belongs to it and is skipped after.

    So a court inside a ring of safe ground is never found on its own: use `search_components` for that.
    """
    safe = np.ascontiguousarray(safe)
    visited = np.zeros(seen.shape, np.int32)
    area = safe[seen.slices]
    rows, cols = np.nonzero(area)
    for row, col in zip(rows.tolist(), cols.tolist(), strict=True):
        if visited[row, col]:
            continue
        boundary = trace(safe, row + seen.row0, col + seen.col0, TRACE_TIMEOUT)
        if len(boundary) < least_boundary:
            flood(area, visited, row, col, 1)
            continue
        candidate = _candidate(safe, boundary)
        own = candidate.box
        part = visited[
            own.row0 - seen.row0 : own.row1 - seen.row0, own.col0 - seen.col0 : own.col1 - seen.col0
        ]
        if candidate.square_side < least_side:
            part[candidate.component == 1] = 1
            continue
        part[candidate.content == 1] = 1
        yield candidate


def search_components(
    safe: NDArray[np.uint8], seen: Box, least_side: int, least_boundary: int
) -> Iterator[Candidate]:
    """Yield every 8-connected component that holds a safe square, islands inside another zone included."""
    area = np.ascontiguousarray(safe[seen.slices])
    if not area.any():
        return
    side = squares(area)
    label = components(area, side, least_side)
    safe = np.ascontiguousarray(safe)
    for number, where in enumerate(ndimage.find_objects(label), start=1):
        rows, cols = where
        whole = label[where] == number
        first = rows.start, cols.start + int(np.argmax(whole[0]))
        component = _without_crumbs(whole)
        boundary = trace(safe, first[0] + seen.row0, first[1] + seen.col0, TRACE_TIMEOUT)
        if len(boundary) < least_boundary:
            continue
        box = Box(
            rows.start + seen.row0, rows.stop + seen.row0, cols.start + seen.col0, cols.stop + seen.col0
        )
        yield Candidate(
            boundary_cells=boundary,
            box=box,
            content=_content(boundary, box),
            component=component,
            square_side=int((side[where] * component).max()),
        )


def _without_crumbs(component: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return a component without the few cells that touch it at a corner only."""
    parts, _ = ndimage.label(component)
    size = np.bincount(parts.ravel())
    size[0] = 0
    return np.asarray((size >= min(CRUMB, size.max()))[parts], np.uint8)


def _candidate(safe: NDArray[np.uint8], boundary: NDArray[np.int32]) -> Candidate:
    low, high = boundary.min(axis=0), boundary.max(axis=0) + 1
    box = Box(int(low[0]), int(high[0]), int(low[1]), int(high[1]))
    area = np.ascontiguousarray(safe[box.slices])
    label = np.zeros(box.shape, np.int32)
    flood(area, label, int(boundary[0, 0]) - box.row0, int(boundary[0, 1]) - box.col0, 1)
    component = label.astype(np.uint8)
    return Candidate(boundary, box, _content(boundary, box), component, int(squares(component).max()))


def _content(boundary: NDArray[np.int32], box: Box) -> NDArray[np.uint8]:
    local = boundary - np.array([box.row0, box.col0], np.int32)
    rows, cols = box.shape
    return inside(local, 1, rows + 2, cols + 2)[1:-1, 1:-1]
